"""The low-pass that takes gravity out of specific force, and what noise passes through it."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation.noise.residuals import MAD_TO_SD

UNSEEN = 4.382
"""sd of ⟨a⟩ over that of ⟨a − ⟨a⟩⟩ where a has an even spectrum, ⟨⟩ the low-pass: the root of
∫(1 + x⁴)⁻² dx over ∫x⁸(1 + x⁴)⁻⁴ dx."""
BANDWIDTH = 0.833
"""∫(1 + x⁴)⁻² dx: what the low-pass lets through of an even spectrum, over its corner."""
_PER_SETTLING = 20.0  # steps in a time constant
_FEWEST = 16  # of such steps, or of rows where they are fewer
WIDTH = 0.69
"""Of the band just above the corner, over the corner: ∫x⁸(1 + x⁴)⁻⁴ dx over its peak."""
IN_BAND = 1 / 3
"""Of the errors that are fitted there: the others change more slowly."""
LEAST_RATE_VARIANCE = 1e-10
"""(rad/s)²: no gyro's row is better, whatever rounding or interpolation makes of differences."""
BLIND = 3.0
"""Time constants at the ends, where the low-pass has only half of its data."""


def low_pass(values: Array, step: float, settling_s: float) -> Array:
    """What lasts of even columns (n, …): Butterworth of second order, forwards and backwards."""
    length = min(len(values) - 1, round(BLIND * settling_s / step))
    more = np.concatenate([values[length:0:-1], values, values[-2 : -length - 2 : -1]])
    return filter_both_ways(more, step, settling_s)[length : length + len(values)]


def filter_both_ways(values: Array, step: float, settling_s: float) -> Array:
    """The same without any values beyond the ends, where the filter is at rest."""
    corner = np.tan(np.pi / 2 * min(2 * find_corner_Hz(settling_s) * step, 0.99))
    for _ in range(2):
        values = _filter(values, corner)[::-1]
    return values


def _filter(values: Array, corner: float) -> Array:
    """y_i = g (x_i + 2 x_{i−1} + x_{i−2}) − a y_{i−1} − b y_{i−2}, from x_0 at rest: Butterworth's
    filter of second order; its corner is the tangent of half the angle that it turns in a row.

    A triangular solve does it: SciPy's filters would be half a second of loading to every command.
    """
    from scipy.linalg.lapack import dtbtrs  # here, so that what only reads a log loads no SciPy

    over = 1 + np.sqrt(2) * corner + corner**2
    away = (values - values[0]).reshape(len(values), -1)
    sums = away.copy()
    sums[1:] += 2 * away[:-1]
    sums[2:] += away[:-2]
    band = np.empty((3, len(values)), order="F")
    band[0], band[1] = 1.0, 2 * (corner**2 - 1) / over
    band[2] = (1 - np.sqrt(2) * corner + corner**2) / over
    found = dtbtrs(band, sums * (corner**2 / over), uplo="L", diag="U")[0]
    return np.asarray(found.reshape(values.shape) + values[0])


def find_corner_Hz(settling_s: float) -> float:
    """The corner of the low-pass with a time constant."""
    return float(np.sqrt(2.0) / (2 * np.pi * settling_s))


def measure_force_variance(force: Array, by: Array, step: float, settling_s: float) -> float:
    """The variance of a row of white noise that would pass the low-pass as this force does.

    It is read off just above the corner, ⟨f − ⟨f⟩⟩, without what known errors do there.

    Parameters: force (n, 3) and what q errors add to it (n, 3, q), in axes that hardly turn.
    """
    together = np.concatenate([force[:, :, None], by], axis=2)
    every = max(min(int(settling_s / (_PER_SETTLING * step)), len(together) // _FEWEST), 1)
    if every > 1:  # means of some rows: nothing just above the corner changes within them
        starts = np.arange(0, len(together) - every + 1, every)
        together = np.add.reduceat(together, starts, axis=0)[: len(starts) - 1] / every
        step *= every
    left = low_pass(together - low_pass(together, step, settling_s), step, settling_s)
    edge = min(round(BLIND * settling_s / step), len(left) // 4)
    inner = left[edge : len(left) - edge].reshape(-1, left.shape[2])
    size = np.maximum(np.sqrt((inner**2).sum(axis=0)), 1e-300)
    found = np.linalg.lstsq(inner[:, 1:] / size[1:], inner[:, 0], rcond=1e-9)[0]
    noise = inner[:, 0] - (inner[:, 1:] / size[1:]) @ found
    corner = find_corner_Hz(settling_s)
    freedom = 3 * 2 * WIDTH * corner * step * (len(left) - 2 * edge)
    fitted = min(by.shape[2] * IN_BAND, 0.75 * freedom)
    variance = float(np.mean(noise**2)) * freedom / max(freedom - fitted, 1e-9)
    return float(every * UNSEEN**2 * variance / find_passed(step, settling_s))


def find_passed(step: float, settling_s: float) -> float:
    """Which part of the variance of white noise passes the low-pass."""
    return min(BANDWIDTH * 2 * find_corner_Hz(settling_s) * step, 1.0)


def measure_rate_variance(rate: Array) -> float:
    """The variance of a gyro's noise (n, 3), by third differences, which motion hardly has."""
    if len(rate) < 4:
        return LEAST_RATE_VARIANCE
    jerk = np.diff(rate, n=3, axis=0)
    found = float(np.mean((MAD_TO_SD * np.median(np.abs(jerk), axis=0)) ** 2) / 20)
    return max(found, LEAST_RATE_VARIANCE)
