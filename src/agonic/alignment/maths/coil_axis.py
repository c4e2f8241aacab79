"""A coil's field by the ampere, from readings at many currents while the ambient field drifts.

Of every stretch of constant current the mean is one observation,

    y_j = k I_j + q I_j² + Σ_r d_r φ_r(t_j) + M b_j + e_j,

k the coil's vector, nT/A, q what is even in the current (heating), φ a slow drift (Legendre
polynomials of time), b the reference's field with M what it adds in the magnetometer's axes. With
equal and opposite currents k is the mean of (y₊ − y₋)/2I and the rest cancels.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.maths.estimation.noise.residuals import correlation_length


class Stretch(NamedTuple):
    """Stretches of constant current: mean current, time and field (k,), (k,), (k, 3), counts."""

    current: Array
    time: Array
    field: Array
    reference: Array | None
    counts: NDArray[np.int64]


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


def find_stretches(
    time: Array, current: Array, field: Array, reference: Array | None, settle_s: float, step: float
) -> Stretch:
    """Means over stretches in which the current stays within `step`, those settling left out."""
    jumps = np.abs(np.diff(current)) > step
    first = np.concatenate([[0], np.flatnonzero(jumps) + 1, [len(time)]])
    rows = []
    for begin, end in pairwise(first):
        own = np.arange(begin, end)
        own = own[time[own] - time[begin] >= settle_s]
        if len(own):
            rows.append(own)
    return Stretch(
        np.array([current[own].mean() for own in rows]),
        np.array([time[own].mean() for own in rows]),
        np.array([field[own].mean(axis=0) for own in rows]),
        None if reference is None else np.array([reference[own].mean(axis=0) for own in rows]),
        np.array([len(own) for own in rows]),
    )


class Fitted(NamedTuple):
    """Coefficients (c, 3) of columns of the current, their spread (c, c) for noise of 1, and the
    variance (3,) of a mean of the usual count; residuals (n, 3) of the weighted means."""

    coefficients: Array
    spread: Array
    variance: Array
    residuals: Array
    freedom: int


def evaluate(seen: Stretch, columns: Array, drift: int) -> Fitted:
    """Columns (n, c) of the current beside the drift and the reference, by weighted squares."""
    parts = [columns, legvander(_centre_times(seen.time), drift)]
    if seen.reference is not None:
        b = seen.reference - seen.reference.mean(axis=0)
        parts.append(b / max(float(np.abs(b).max()), 1e-9))
    weight = np.sqrt(seen.counts / seen.counts.mean())[:, None]
    design, wanted = np.hstack(parts) * weight, seen.field * weight
    # exact copies of a column, as of a reference that never changes, share what they explain
    inverse = np.linalg.pinv(design, rcond=1e-10)
    solution = inverse @ wanted
    left = wanted - design @ solution
    freedom = len(left) - int(np.linalg.matrix_rank(design, tol=1e-8))
    c = columns.shape[1]
    return Fitted(
        solution[:c],
        (inverse @ inverse.T)[:c, :c],
        (left**2).sum(axis=0) / max(freedom, 1),
        left,
        freedom,
    )


def estimate(seen: Stretch, drift: int, *, even: bool) -> CoilEstimate:
    """k and q with the noise from what is left."""
    scale = float(np.abs(seen.current).max())
    unit = seen.current / scale
    found = evaluate(seen, np.stack([unit, unit**2] if even else [unit], axis=1), drift)
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


def estimate_levels(seen: Stretch, drift: int, level: NDArray[np.int64]) -> tuple[Array, Array]:
    """k of each level of the current's size, (l, 3) nT/A, and standard errors (l, 3).

    `level` (n,) numbers the levels from 0; −1 marks stretches of no current.
    """
    count = int(level.max()) + 1
    scale = float(np.abs(seen.current).max())
    columns = np.where(level[:, None] == np.arange(count), seen.current[:, None] / scale, 0.0)
    found = evaluate(seen, columns, drift)
    sd = np.sqrt(np.diag(found.spread)[:, None] * found.variance)
    return found.coefficients / scale, sd / scale


def _centre_times(time: Array) -> Array:
    """Times brought to −1…1."""
    return np.asarray(2 * (time - time[0]) / max(float(time[-1] - time[0]), 1e-9) - 1)


def choose_drift(seen: Stretch, most: int, *, even: bool) -> int:
    """The degree of the drift with the smallest Akaike criterion, corrected for few stretches."""
    scores = []
    for degree in range(max(min(most, len(seen.time) - 8), 0) + 1):
        found = estimate(seen, degree, even=even)
        n, m = len(seen.time), len(seen.time) - found.freedom
        size = float(np.log((found.residuals**2).sum(axis=0) / n + 1e-300).sum())
        scores.append(n * size + 3 * 2 * m * n / max(n - m - 1, 1))
    return int(np.argmin(scores))
