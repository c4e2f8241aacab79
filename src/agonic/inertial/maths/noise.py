"""How noisy readings, force and rates are, by what a step leaves of each."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.inertial.maths.correlation import FEWEST
from agonic.inertial.maths.factors import Felt, Log, sum_force
from agonic.inertial.maths.step import Step, predict_cost, reduce_to_params
from agonic.maths.estimation.noise.batch_means import compute_scatter
from agonic.maths.rotations.track import Sums
from agonic.units import STANDARD_GRAVITY_M_S2

_DOUBT = 0.2  # of the logarithm of the variance that rates and force start from
_LOGS = np.linspace(-6.0, 24.0, 6001)
_ALIKE = 1.5  # variances below and above the corner of the low-pass
_LEAST_FREEDOM = 0.05  # of the residuals


def update_variances(
    groups: tuple[Sums, ...], variances: Array, starts: Array, passed: Array, step: Step
) -> Array:
    """The variance of each kind after a step: Σ w r² over its own share of the freedom (Förstner
    1979), which is that of restricted likelihood.

    Parameters: variances to start from, 0 where nothing is expected: that of the rates is told by
    third differences, which a motion that jitters makes too large; which part of white noise is
    left of each kind, less where it is smoothed.
    """
    found = []
    for group, variance, start, share in zip(groups, variances, starts, passed, strict=False):
        fitted = np.einsum("nij,nji->", group.states.diagonal, step.spread.diagonal)
        fitted += 2 * np.einsum("nij,nij->", group.states.below, step.spread.below)
        fitted += np.einsum("ij,ji->", reduce_to_params(group, step.by_params), step.covariance)
        size = share * group.size
        freedom = max(size - float(fitted) / variance, _LEAST_FREEDOM * size)
        cost = max(predict_cost(group, step), 0.0)
        found.append(settle_variance(cost / freedom, freedom, start))
    return np.array(found)


def settle_variance(found: float, freedom: float, start: float) -> float:
    """The most probable variance θ of so many residuals that were expected to have another one, θ₀.

    What is expected is either right or far off, so u = log(θ/θ₀) has a Cauchy prior of scale s:

        ν/2 (u + found/θ) + log(1 + (u/s)²) is least,   θ = θ₀ eᵘ,   s = `_DOUBT`.

    Where nothing is expected, θ₀ = 0, it is what was found.

    >>> round(settle_variance(1.0, 100.0, 30.0), 1), round(settle_variance(1.0, 10.0, 1.5), 1)
    (1.0, 1.5)
    """
    if start <= 0.0:
        return found
    cost = freedom / 2 * (_LOGS + found / start * np.exp(-_LOGS)) + np.log1p((_LOGS / _DOUBT) ** 2)
    return float(start * np.exp(_LOGS[np.argmin(cost)]))


def measure_force(force: Sums, white: float) -> float:
    """The variance of white noise that pulls as much as the force does for long: batch means."""
    pulls = (force.before + force.after)[:, :2] / STANDARD_GRAVITY_M_S2
    expected = white * force.size / 3 * np.eye(2)
    return white * compute_scatter(pulls, expected, fewest=FEWEST).correlation


def is_white(log: Log, felt: Felt, attitudes: Array, below: float) -> bool:
    """Whether the force is as noisy above the corner of the low-pass as `below`, a variance.

    Then nothing is to be smoothed away, and what the force says of fast attitude is worth as much
    as it states.
    """
    whole = sum_force(log._replace(settling_s=0.0), felt, attitudes)
    return bool(below / _ALIKE < whole.cost / whole.size < below * _ALIKE)
