"""How probable readings are under several noise models at once, by the innovations of the filter.

The filter of `kalman` with residuals that are linear in the state: r(x) = r₀ + H x. Then all models
take the same steps with other numbers, so that one pass over the readings serves them all. The
covariances P are kept as they are, not as U D Uᵀ: nothing but the likelihood is taken from them.

Source: F. C. Schweppe (1965), IEEE Transactions on Information Theory 11(1), 61–70.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation.filters.kalman import FilterState, Model

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
