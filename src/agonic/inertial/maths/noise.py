"""How noisy readings, force and rates are, by what a step leaves of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.inertial.maths.correlation import (
    Step,
    predict_cost,
    reduce_to_params,
    solve_step,
)
from agonic.inertial.maths.factors import UP_AT_REST, Felt, Log, steady_force
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.filters.smoother import Sums
from agonic.maths.estimation.loss import cauchy
from agonic.maths.estimation.noise.batch_means import measure_correlation
from agonic.maths.rotations.low_pass import find_passed
from agonic.units import STANDARD_GRAVITY_M_S2

SETTLED = 0.02
"""Of a standard error, or of a variance: what moves less has settled."""
_STEPS = 6  # of the variances in a round
_LEAST_FORCE = 1e-3  # m/s²: no accelerometer's row is better
_LEAST_RATE = 1e-5  # rad/s: nor a gyro's
_USUAL_RATE = 1e-3  # rad/s/√Hz, of a gyro
_SMALLEST = 1e-3  # of the variance that a gyro shows
_TUKEY = 0.961  # Σ w q / Σ w of Gaussian vectors under Tukey's loss, q = r²/3
_CAUCHY = 0.914  # the same under Cauchy's
_DOUBT = 0.2  # of the logarithm of the variance that rates and force start from
_LOGS = np.linspace(-6.0, 24.0, 6001)
_ALIKE = 1.5  # variances below and above the corner of the low-pass
_TOGETHER = 0.3  # correlation of a row's force with the next
_LEAST_FREEDOM = 0.05  # of the residuals


class Expected(NamedTuple):
    """What is known beforehand of the noise of readings, force and rates, (3,) each.

    The least variances; those to start from, 0 where nothing is expected: that of the rates is told
    by third differences, which a motion that jitters makes too large; which part of white noise is
    left of each kind, less where it is smoothed; and what a robust loss leaves of a variance.
    """

    least: Array
    starts: Array
    passed: Array
    left: Array


def expect_noise(log: Log, readings_weighed: bool, slips_weighed: bool) -> Expected:
    """What the log itself tells of its noise."""
    least = np.array([1e-9, max(log.force_sd, _LEAST_FORCE), max(log.rate_sd, _LEAST_RATE)]) ** 2
    starts = least * [0.0, 1.0, log.rate_sd > _LEAST_RATE]  # rates between rows show no noise
    passed = np.array([1.0, find_passed(log.step_s, log.settling_s), 1.0])
    left = np.array([_TUKEY if readings_weighed else 1.0, 1.0, _CAUCHY if slips_weighed else 1.0])
    return Expected(least, starts, passed, left)


def start_variances(log: Log, expected: Expected, noise_sd: float) -> Array:
    """The variances to start from, with that of known headings where there are any."""
    first = np.maximum(expected.least, [noise_sd**2, 0.0, 0.0])
    first[2] = max(first[2], _USUAL_RATE**2 / log.step_s)  # too stiff a gyro would stay so
    return first if log.headings is None else np.append(first, 1.0)


def settle(
    groups: Sequence[Sums],
    variances: Array,
    expected: Expected,
    memory: float,
    scatter: float | None,
    prior: leastsq.Prior,
    params: Array,
) -> tuple[Step, Array]:
    """The step with the variances that it leaves, found by turns.

    Parameters: by how much the readings scatter more for long; the variance of known headings, if
    any.
    """
    for _ in range(_STEPS):
        step = solve_step(groups, variances, prior, params)
        updated = update_variances(groups[:3], variances, expected, step) / expected.left
        updated[1] = measure_force(groups[1], updated[1])
        updated = np.maximum(updated, expected.least * [1.0, 0.0, _SMALLEST]) * [memory, 1.0, 1.0]
        if scatter is not None:
            updated = np.append(updated, scatter)
        change, variances = np.abs(np.log(updated / variances)).max(), updated
        if change < SETTLED:
            break
    return step, variances


def update_variances(
    groups: Sequence[Sums], variances: Array, expected: Expected, step: Step
) -> Array:
    """The variance of each kind after a step: Σ w r² over its own share of the freedom (Förstner
    1979), which is that of restricted likelihood.
    """
    found, (_, starts, passed, _) = [], expected
    for group, variance, start, share in zip(groups, variances, starts, passed, strict=False):
        fitted = np.einsum("nij,nji->", group.states.diagonal, step.spread.diagonal)
        fitted += 2 * np.einsum("nij,nij->", group.states.below, step.spread.below)
        fitted += np.einsum("ij,ji->", reduce_to_params(group, step.by_params), step.covariance)
        size = share * group.size
        freedom = max(size - float(fitted) / variance, _LEAST_FREEDOM * size)
        cost = max(predict_cost(group, step), 0.0)
        spread = cost / freedom if freedom > 0.0 else start  # where none tells it
        found.append(settle_variance(spread, freedom, start))
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
    return white * measure_correlation(pulls, expected)


def find_memory(along: Array, weights: Array, interval: Index) -> float:
    """By how much readings scatter more for long than white noise does: batch means.

    Parameters: residuals (n,) that no turn of the attitude makes, their weights, and the interval
    between states that each is of.
    """
    weighted = weights * along
    sums = np.bincount(interval, weighted)[:, None].astype(np.float64)
    white = np.array([[float(weighted @ weighted)]])
    return measure_correlation(sums, white)


def weigh_slips(slips: Array, variance: float) -> Array:
    """How much each step of the gyro counts, by its square (N − 1,) of three numbers."""
    return cauchy().weight(slips / (3 * variance))


def is_white(log: Log, felt: Felt, attitudes: Array, below: float) -> bool:
    """Whether the force is as noisy above the corner of the low-pass as `below`, a variance, and
    each row by itself.

    Then nothing is to be smoothed away, and what the force says of fast attitude is worth as much
    as it states. A vehicle that is shaken moves from row to row.
    """
    level, *_ = steady_force(log._replace(settling_s=0.0), felt, attitudes)
    left = level - UP_AT_REST
    whole = float(np.mean(left**2))
    together = float(np.mean(left[1:] * left[:-1])) / whole
    return bool(below / _ALIKE < whole < below * _ALIKE) and together < _TOGETHER
