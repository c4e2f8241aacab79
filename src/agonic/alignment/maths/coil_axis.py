"""A coil's field by the ampere, from readings at many currents while the ambient field drifts.

With equal and opposite currents k is the mean of (y₊ − y₋)/2I and the rest cancels; what is even in
the current (heating) is q I².
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.alignment.maths.stretches import Stretches, fit_columns
from agonic.arrays import Array
from agonic.maths.estimation.noise.residuals import correlation_length


class CoilEstimate(NamedTuple):
    """k (3,) nT/A and q (3,) nT/A² with the covariance of each axis's (k, q), (3, 2, 2).

    `noise` (3,) is that of one reading, nT; `correlation` (3,) how many stretches count as one.
    `drift` is the degree of the drift, `residuals` (n, 3) those of the means.
    """

    linear: Array
    even: Array
    covariance: Array
    noise: Array
    correlation: Array
    residuals: Array
    drift: int
    freedom: int


def estimate(current: Array, seen: Stretches, drift: int, *, even: bool) -> CoilEstimate:
    """k and q with the noise from what is left."""
    scale = float(np.abs(current).max())
    unit = current / scale
    found = fit_columns(seen, np.stack([unit, unit**2] if even else [unit], axis=1), drift)
    correlation = np.array(
        [correlation_length(left, np.ones(len(left))) for left in found.residuals.T]
    )
    covariance = np.zeros((3, 2, 2))
    c = 1 + int(even)
    per = np.array([scale, scale**2])[:c]
    noise = (found.variance * correlation)[:, None, None]
    covariance[:, :c, :c] = noise * found.spread / np.outer(per, per)
    return CoilEstimate(
        found.coefficients[0] / scale,
        found.coefficients[1] / scale**2 if even else np.zeros(3),
        covariance,
        np.sqrt(found.variance * seen.counts.mean()),
        correlation,
        found.residuals,
        drift,
        found.freedom,
    )


def estimate_levels(
    current: Array, seen: Stretches, drift: int, level: NDArray[np.int64]
) -> tuple[Array, Array]:
    """k of each level of the current's size, (l, 3) nT/A, and standard errors (l, 3).

    `level` (n,) numbers the levels from 0; −1 marks stretches of no current.
    """
    count = int(level.max()) + 1
    scale = float(np.abs(current).max())
    columns = np.where(level[:, None] == np.arange(count), current[:, None] / scale, 0.0)
    found = fit_columns(seen, columns, drift)
    sd = np.sqrt(np.diag(found.spread)[:, None] * found.variance)
    return found.coefficients / scale, sd / scale


def choose_drift(current: Array, seen: Stretches, most: int, *, even: bool) -> int:
    """The degree of the drift with the smallest Akaike criterion, corrected for few stretches."""
    scores = []
    for degree in range(max(min(most, len(seen.time) - 8), 0) + 1):
        found = estimate(current, seen, degree, even=even)
        n, m = len(seen.time), len(seen.time) - found.freedom
        size = float(np.log((found.residuals**2).sum(axis=0) / n + 1e-300).sum())
        scores.append(n * size + 3 * 2 * m * n / max(n - m - 1, 1))
    return int(np.argmin(scores))
