"""What goes with a current or an angle, by linear least squares over stretches of readings.

Of every stretch in which nothing moved the mean is one observation on each axis: all relations
between the instruments are linear in the means, so nothing is lost by them, whatever their rates.

    y_j = Σ_c a_c x_c(j) + Σ_r d_r φ_r(t_j) + M b_j + e_j,

x columns of what was set, φ a slow drift (Legendre polynomials of time), b a reference's field
with M what it adds in the magnetometer's axes. Columns that cancel over the stretches, as equal
and opposite currents do, are free of everything else: k, a coil's field by the ampere, is then the
mean of (y₊ − y₋)/2I; what is even in the current (heating) is q I². The field of a platform that is
turned beneath a magnetometer is harmonics of the angle.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray
from scipy.special import chdtrc

from agonic.arrays import Array, Index, Mask
from agonic.maths.estimation.noise.residuals import correlation_length


class Beside(NamedTuple):
    """Means (k, 3) of a reference at the moments of the readings, and its scatter (3,). `share`
    (k,) is the standard deviation of a mean over that of one reading: neighbours that are
    interpolated are shared."""

    field: Array
    share: Array
    scatter: Array


class Stretches(NamedTuple):
    """Means of k stretches: time (k,), field (k, 3), and counts (k,). `scatter` (3,) is the
    standard deviation of one reading on each axis within the stretches, NaN where too few show it.
    `beside` is the table of a reference at the same moments."""

    time: Array
    field: Array
    counts: NDArray[np.int64]
    scatter: Array
    beside: Beside | None = None

    @property
    def weight(self) -> Array:
        """Square roots of the weights (k, 1) of the means, 1 for one of the usual count."""
        return np.asarray(np.sqrt(self.counts / self.counts.mean())[:, None])

    def select(self, rows: slice) -> Stretches:
        """Some of the stretches."""
        beside = self.beside
        return self._replace(
            time=self.time[rows],
            field=self.field[rows],
            counts=self.counts[rows],
            beside=beside and beside._replace(field=beside.field[rows], share=beside.share[rows]),
        )


def split(changed: Mask) -> list[Index]:
    """The rows between changes (n − 1,) from one reading to the next."""
    return np.split(np.arange(len(changed) + 1), np.flatnonzero(changed) + 1)


def find_rows(numbers: NDArray[np.int64] | Array, wanted: NDArray[np.int64]) -> list[Index]:
    """The rows of each wanted number, in order."""
    order = np.argsort(numbers, kind="stable")
    first, last = (np.searchsorted(numbers[order], wanted, side) for side in ("left", "right"))
    return [order[begin:end] for begin, end in zip(first, last, strict=True)]


def average(values: Array, rows: list[Index]) -> Array:
    """Means (k, …) of values (n, …) over the rows of each stretch."""
    counts = np.array([len(own) for own in rows])
    sums = sum_each(values, rows)
    return np.asarray(sums / counts.reshape(-1, *[1] * (sums.ndim - 1)))


def sum_each(values: Array, rows: list[Index]) -> Array:
    """Sums (k, …) of values (n, …) over the rows of each stretch."""
    first = np.cumsum([0, *(len(own) for own in rows[:-1])])
    return np.asarray(np.add.reduceat(values[np.concatenate(rows)], first, axis=0))


def average_stretches(
    rows: list[Index], time: Array, field: Array, reference: tuple[Array, Array] | None = None
) -> Stretches:
    """The table of stretches of readings (n, 3), beside times and field (m, 3) of a reference. The
    reference is interpolated linearly in time at each reading."""
    made = Stretches(
        time=average(time, rows),
        field=average(field, rows),
        counts=np.array([len(own) for own in rows]),
        scatter=_find_scatter([(time[own], field[own]) for own in rows]),
    )
    if reference is None:
        return made
    read, other = reference
    parts = [_find_weights(time[own], read) for own in rows]
    beside = Beside(
        field=np.array([weights @ other[at] for at, weights in parts]),
        share=np.array([float(np.sqrt((weights**2).sum())) for _, weights in parts]),
        scatter=_find_scatter([(read[at], other[at]) for at, _ in parts]),
    )
    return made._replace(beside=beside)


def _find_weights(time: Array, known: Array) -> tuple[Index, Array]:
    """Rows of the known times and their weights in the mean of linear interpolations at `time`."""
    if len(known) == 1:
        return np.zeros(1, dtype=np.intp), np.ones(1)
    right = np.clip(np.searchsorted(known, time), 1, len(known) - 1)
    share = (time - known[right - 1]) / (known[right] - known[right - 1])
    share = np.clip(share, 0.0, 1.0)
    rows, at = np.unique(np.concatenate([right - 1, right]), return_inverse=True)
    weights = np.bincount(at, np.concatenate([1 - share, share])) / len(time)
    used = weights > 0
    return rows[used], weights[used]


class Lines(NamedTuple):
    """Straight lines in time through k stretches: slopes and sums of squares that they leave,
    (k, 3), the sums of squares of the times about their mean, (k,), and the freedom (k,)."""

    slope: Array
    squares: Array
    power: Array
    freedom: NDArray[np.int64]


def fit_lines(parts: Iterable[tuple[Array, Array]]) -> Lines:
    """The lines of times (n,) and values (n, 3), of three rows or more."""
    found = []
    for time, values in parts:
        away, about = time - time.mean(), values - values.mean(axis=0)
        power = float(away @ away)
        slope = away @ about / (power or 1.0)  # times that are all the same have none
        found.append((slope, ((about - np.outer(away, slope)) ** 2).sum(axis=0), power, len(time)))
    slopes, squares, powers, counts = zip(*found, strict=True) if found else ([], [], [], [])
    own = np.array(counts, dtype=np.int64) - 2
    return Lines(np.reshape(slopes, (-1, 3)), np.reshape(squares, (-1, 3)), np.array(powers), own)


def _find_scatter(parts: list[tuple[Array, Array]]) -> Array:
    """Standard deviations (3,) of one reading about straight lines in time, pooled."""
    lines = fit_lines(part for part in parts if len(part[0]) > 2)
    freedom = int(lines.freedom.sum())
    return np.sqrt(lines.squares.sum(axis=0) / freedom) if freedom >= 2 else np.full(3, np.nan)


class Fitted(NamedTuple):
    """Coefficients (c, 3) of the columns, their spread (c, c) for a variance of 1 of a mean of the
    usual count, that variance (3,) by the residuals, and the residuals (k, 3) of weighted means."""

    coefficients: Array
    spread: Array
    variance: Array
    residuals: Array
    freedom: int


def fit_columns(seen: Stretches, columns: Array, drift: int) -> Fitted:
    """Coefficients of columns (k, c) beside a drift of some degree and the reference, if any."""
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
    """k (3,) nT/A and q (3,) nT/A² with the covariance of each axis's (k, q), (3, 2, 2). `noise`
    (3,) is that of one reading, nT; `correlation` (3,) how many stretches count as one. `drift` is
    the degree of the drift, `residuals` (n, 3) those of the means."""

    linear: Array
    even: Array
    covariance: Array
    noise: Array
    correlation: Array
    residuals: Array
    drift: int
    freedom: int


def estimate_coil(current: Array, seen: Stretches, drift: int, *, even: bool) -> CoilEstimate:
    """k and, where something may be even in the current, q; the noise from what is left."""
    scale = float(np.abs(current).max())
    powers = [1, 2] if even else [1]
    found = fit_columns(seen, (current[:, None] / scale) ** powers, drift)
    correlation = np.array(
        [correlation_length(left, np.ones(len(left))) for left in found.residuals.T]
    )
    covariance, c = np.zeros((3, 2, 2)), len(powers)
    per = scale ** np.array(powers, dtype=np.float64)
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


def choose_drift(current: Array, seen: Stretches, most: int, *, even: bool) -> int:
    """The degree of the drift with the smallest Akaike criterion, corrected for few stretches."""
    scores, n = [], len(seen.time)
    for degree in range(max(min(most, n - 8), 0) + 1):
        found = estimate_coil(current, seen, degree, even=even)
        m = n - found.freedom
        size = float(np.log((found.residuals**2).sum(axis=0) / n + 1e-300).sum())
        scores.append(n * size + 3 * 2 * m * n / max(n - m - 1, 1))
    return int(np.argmin(scores))


class Harmonics(NamedTuple):
    """What goes round with the platform once and, with settings enough, twice in a turn. `parts`
    (h, 2, 3): cosine and sine on each axis of the magnetometer, with `covariance` (h, 3, 2, 2);
    `shape` (k, 3) what goes round, `residuals` (k, 3), `noise` (k, 3) of the means."""

    parts: Array
    covariance: Array
    shape: Array
    residuals: Array
    noise: Array


def fit_harmonics(
    seen: Stretches, angle_rad: Array, drift: int, unrest: Array, *, twice: bool
) -> Harmonics:
    """field = c0 + c1 cos ψ + s1 sin ψ (+ c2 cos 2ψ + s2 sin 2ψ) + what changes beside it.

    A magnet on the platform goes round once in a turn, what the ambient field magnetizes in it
    twice; that field follows a `drift` of some degree, or the reference, and may go round itself by
    `unrest` (3,), half of it twice. Covariances are widened where residuals are larger than the
    noise within the settings at angles (k,)."""
    turns = np.multiply.outer([1, 2] if twice else [1], angle_rad)
    columns = np.stack([np.cos(turns), np.sin(turns)], axis=1).reshape(-1, len(angle_rad)).T
    found = fit_columns(seen, columns, drift)
    # with no repeated readings there are only the residuals
    sd = np.where(np.isfinite(seen.scatter), np.maximum(seen.scatter, 1e-6), 1.0)
    variance = sd**2 / seen.counts.mean()
    chi2 = float((found.residuals**2 / variance).sum())
    wide = max(chi2 / max(3 * found.freedom, 1), 1.0)
    each = [found.spread[k : k + 2, k : k + 2] for k in range(0, 2 * len(turns), 2)]
    itself = np.multiply.outer([1, 1 / 4][: len(turns)], unrest**2)
    return Harmonics(
        parts=found.coefficients.reshape(-1, 2, 3),
        covariance=np.stack(each)[:, None] * (wide * variance)[:, None, None]
        + itself[:, :, None, None] * np.eye(2),
        shape=columns @ found.coefficients,
        residuals=found.residuals / seen.weight,
        noise=sd / np.sqrt(seen.counts)[:, None],
    )


def compute_size(parts: Array, covariance: Array) -> tuple[float, float, float]:
    """The size of a harmonic, its standard error, and how often chance makes one as large. A vector
    of length r that goes round makes |c|² + |s|² = 2 r²; what noise adds on average is taken
    off."""
    squares = float((parts**2).sum()) / 2
    spread = float(np.trace(covariance, axis1=1, axis2=2).sum()) / 2
    size = float(np.sqrt(max(squares - spread, 0.0)))
    along = float(np.einsum("ia,aij,ja->", parts, covariance, parts))
    sd = float(np.sqrt(along) / 2 / np.sqrt(squares)) if squares > 0 else 0.0
    chi2 = float(np.einsum("ia,aij,ja->", parts, np.linalg.inv(covariance), parts))
    return size, max(sd, float(np.sqrt(spread / 6))), float(chdtrc(6, chi2))
