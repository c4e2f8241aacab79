"""What goes with a current or an angle, by linear least squares over stretches of readings.

Of every stretch the mean is one observation on each axis,

    y_j = Σ_c a_c x_c(j) + Σ_r d_r φ_r(t_j) + M b_j + e_j,

x columns of what was set, φ a slow drift (Legendre polynomials of time), b a reference's field
with M what it adds in the magnetometer's axes. Columns that cancel over the stretches, as equal
and opposite currents do, are free of everything else: k, a coil's field by the ampere, is then the
mean of (y₊ − y₋)/2I; what is even in the current (heating) is q I². The field of a platform that is
turned beneath a magnetometer is harmonics of the angle.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray
from scipy.special import chdtrc

from agonic.alignment.maths.stretches import Stretches
from agonic.arrays import Array
from agonic.maths.estimation.noise.residuals import correlation_length


class Fitted(NamedTuple):
    """Coefficients (c, 3) of the columns, their spread (c, c) for a variance of 1 of a mean of the
    usual count, that variance (3,) by the residuals, and the residuals (k, 3) of weighted means."""

    coefficients: Array
    spread: Array
    variance: Array
    residuals: Array
    freedom: int


def fit_columns(seen: Stretches, columns: Array, drift: int) -> Fitted:
    """Coefficients of columns (k, c) beside a drift of some degree and the reference, if any.

    >>> from agonic.alignment.maths.stretches import average_stretches
    >>> current = np.tile([1.0, -1.0], 6)
    >>> field = np.outer(current, [3.0, 0.0, 4.0]) + [50.0, 0.0, 20.0]
    >>> seen = average_stretches([np.array([k]) for k in range(12)], np.arange(12.0), field)
    >>> (fit_columns(seen, current[:, None], 1).coefficients.round(9) + 0.0).tolist()
    [[3.0, 0.0, 4.0]]
    """
    along = 2 * (seen.time - seen.time[0]) / max(float(seen.time[-1] - seen.time[0]), 1e-9) - 1
    parts = [columns, legvander(along, drift)]
    if seen.beside is not None:
        b = seen.beside.field - seen.beside.field.mean(axis=0)
        parts.append(b / max(float(np.abs(b).max()), 1e-9))
    design, wanted = np.hstack(parts) * seen.weight, seen.field * seen.weight
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


class Harmonics(NamedTuple):
    """What goes round with the platform, with covariances for each axis of the magnetometer.

    `once` and `twice` (2, 3): cosine and sine of the angle and of twice the angle (`None` where
    there are too few settings); `once_covariance`, `twice_covariance` (3, 2, 2), one an axis;
    `shape` (k, 3) what goes round, `residuals` (k, 3), and the `noise` (k, 3) of the means.
    """

    once: Array
    once_covariance: Array
    twice: Array | None
    twice_covariance: Array | None
    shape: Array
    residuals: Array
    noise: Array


def fit_harmonics(seen: Stretches, angle_rad: Array, drift: int, *, twice: bool) -> Harmonics:
    """field = c0 + c1 cos ψ + s1 sin ψ (+ c2 cos 2ψ + s2 sin 2ψ) + what changes beside it.

    A magnet on the platform goes round once in a turn, what the ambient field magnetizes in it
    twice. The ambient field follows a `drift` of some degree, or the reference. Covariances are
    widened where residuals are larger than the noise within the settings at angles (k,).

    Source: the magnet rotating on the axis of a turntable, by the expansion in angular harmonics.

    >>> from agonic.alignment.maths.stretches import average_stretches
    >>> angle = np.radians(np.arange(0.0, 360.0, 30.0))
    >>> field = 3.0 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    >>> seen = average_stretches([np.array([k]) for k in range(12)], np.arange(12.0), field)
    >>> found = fit_harmonics(seen, angle, 0, twice=False)
    >>> (found.once.round(6) + 0.0).tolist()
    [[3.0, 0.0, 0.0], [0.0, 3.0, 0.0]]
    """
    turns = np.multiply.outer([1, 2] if twice else [1], angle_rad)
    columns = np.stack([np.cos(turns), np.sin(turns)], axis=1).reshape(-1, len(angle_rad)).T
    found = fit_columns(seen, columns, drift)
    # with no repeated readings the residuals alone tell
    sd = np.where(np.isfinite(seen.scatter), np.maximum(seen.scatter, 1e-6), 1.0)
    variance = sd**2 / seen.counts.mean()
    chi2 = float((found.residuals**2 / variance).sum())
    wide = max(chi2 / max(3 * found.freedom, 1), 1.0)
    spreads = (wide * variance)[:, None, None] * found.spread
    return Harmonics(
        once=found.coefficients[:2],
        once_covariance=spreads[:, :2, :2],
        twice=found.coefficients[2:4] if twice else None,
        twice_covariance=spreads[:, 2:4, 2:4] if twice else None,
        shape=columns @ found.coefficients,
        residuals=found.residuals / seen.weight,
        noise=sd / np.sqrt(seen.counts)[:, None],
    )


def widen(found: Harmonics, amplitude: Array) -> Harmonics:
    """With an ambient field that may go round by an amplitude (3,) on each axis, in covariances."""
    more = (np.asarray(amplitude) ** 2)[:, None, None] * np.eye(2)
    twice = found.twice_covariance
    return found._replace(
        once_covariance=found.once_covariance + more,
        twice_covariance=None if twice is None else twice + more / 4.0,
    )


def compute_size(parts: Array, covariance: Array) -> tuple[float, float, float]:
    """The size of a harmonic, its standard error, and how often chance makes one as large.

    A vector of length r that goes round makes |c|² + |s|² = 2 r²; what noise adds on average is
    taken off.
    """
    squares = float((parts**2).sum()) / 2
    spread = float(np.trace(covariance, axis1=1, axis2=2).sum()) / 2
    size = float(np.sqrt(max(squares - spread, 0.0)))
    along = float(np.einsum("ia,aij,ja->", parts, covariance, parts))
    sd = float(np.sqrt(along) / 2 / np.sqrt(squares)) if squares > 0 else 0.0
    chi2 = float(np.einsum("ia,aij,ja->", parts, np.linalg.inv(covariance), parts))
    return size, max(sd, float(np.sqrt(spread / 6))), float(chdtrc(6, chi2))
