"""Noise with memory: how much of the residuals lasts, and how long, by what predicts them best.

A filter that takes lasting errors for white ones learns each of them many times: its standard
errors are too small and it sees jumps where there are none. The errors of the reference and those
of a sensor, seen along the field, are one Gauss–Markov process beside the bias (`kalman`); its size
and time are those under which the first readings are most probable (`likelihoods`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agonic.arrays import Array
from agonic.inflight.tracking.map_estimate import linearise
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.maths.estimation.filters.states import FilterState, Model

ROUNDING = 1e-14
"""Part of the largest prior variance below which the variance of a residual is lost in rounding."""


def compute_likelihoods(
    prior: FilterState,
    models: Sequence[Model],
    times: Array,
    residual: Array,
    jacobian: Array,
    noise: Array,
) -> Array:
    """The log-likelihood (k,) of n residuals under k noise models, −Σ (ln s + z²/2s²).

    Parameters: prior, whose g is widened to `external_sd` where a model has more; times (n,), s;
    residual (n, k), at the state of the prior; jacobian (n, m) by the m numbers of the state;
    noise (n, k), sd of each residual in its own unit.
    """
    k, m = len(models), len(prior.diagonal)
    _, external, external_time, walk, matrix_walk, *_ = np.array(models, dtype=np.float64).T
    covariance = np.tile(prior.covariance, (k, 1, 1))
    covariance[:, 0, 0] += np.maximum(external**2 - prior.diagonal[0], 0.0)
    elapsed = np.diff(times, prepend=prior.time)
    rate = np.where(external > 0, 1.0 / external_time, 0.0)
    decay = np.exp(-elapsed[:, None] * rate)
    stirred = (1.0 - decay**2) * external**2
    walked = np.zeros((k, m))
    walked[:, 1:4], walked[:, 4:] = walk[:, None] ** 2, matrix_walk[:, None] ** 2
    variances = covariance.reshape(k, -1)[:, :: m + 1]  # a view of the diagonals
    moved, total = np.zeros((k, m)), np.zeros(k)
    for i, h in enumerate(jacobian):
        moved[:, 0] *= decay[i]
        covariance[:, 0] *= decay[i, :, None]
        covariance[:, :, 0] *= decay[i, :, None]
        variances += elapsed[i] * walked
        covariance[:, 0, 0] += stirred[i]
        shared = covariance @ h
        variance = shared @ h + noise[i] ** 2
        away = residual[i] + moved @ h
        total += np.log(variance) + away**2 / variance
        gain = shared / variance[:, None]
        moved -= gain * away[:, None]
        covariance -= gain[:, :, None] * shared[:, None, :]
    return -0.5 * total


MEMORY_FROM = 192
"""Readings that can show a memory."""
_CERTAIN = 10.0  # log-likelihood by which a memory must explain the readings better than none
_TIMES = (1.5, 3.0, 6.0, 12.0, 25.0, 50.0, 100.0, 200.0, 400.0)  # readings
_SHARES = (0.15, 0.5, 0.8, 0.97)  # of the variance that lasts
_FEWEST_MEMORIES = 4  # times in the readings: of longer ones nothing is seen


def find_memory(
    prior: FilterState, model: Model, rows: Array, about: Array, total: float
) -> Model | None:
    """The noise model whose lasting part makes rows (k, 6) most probable; None where what is given
    does as well.

    Parameters: `about` (10,) the state that residuals are linear about; `total` the sd of a
    residual, in the unit of the readings.
    """
    step = float(np.median(np.diff(rows[:, 0])))
    gain = float(np.mean(about[4:7]))
    rows = rows[-2048:]
    plain = model._replace(jump_level=0.0, gate=np.inf)
    times = [t * step for t in _TIMES if t * _FEWEST_MEMORIES < len(rows)]
    tried = [
        plain._replace(
            noise=total * float(np.sqrt(1 - share)),
            external_sd=total * gain * float(np.sqrt(share)),
            external_time_s=time,
        )
        for time in times
        for share in _SHARES
    ]
    if total**2 < ROUNDING * prior.covariance.diagonal()[1:].max():
        return None
    without, *values = _compute_likelihoods(prior, [plain, *tried], rows[rows[:, 5] > 0], about)
    return tried[int(np.argmax(values))] if max(values) > without + _CERTAIN else None


def widen_external(prior: FilterState, model: Model) -> FilterState:
    """The prior with what the lasting error may be at its start."""
    first, *others = prior.scales
    return prior._replace(scales=[max(first, model.external_sd**2), *others])


def _compute_likelihoods(
    prior: FilterState, models: list[Model], rows: Array, about: Array
) -> Array:
    """The log-likelihood of rows under each model; the residuals times |s|, in nT."""
    m, noise = len(prior.diagonal), np.array([model.noise for model in models])
    plain, jacobian = linearise(rows, about)
    bent = linearise(rows, about, float(noise.max()))[0] - plain  # as the square of the noise
    matrix = unpack_symmetric(about[4:])
    u = (rows[:, 1:4] - about[1:4]) @ matrix
    steep = np.linalg.norm(u @ matrix, axis=1) / np.linalg.norm(u, axis=1)
    h = np.column_stack([-np.ones(len(rows)), jacobian * steep[:, None]])[:, :m]
    residual = steep[:, None] * (plain[:, None] + bent[:, None] * (noise / noise.max()) ** 2)
    residual += (h @ (prior.state - about)[:m])[:, None]
    return compute_likelihoods(prior, models, rows[:, 0], residual, h, steep[:, None] * noise)
