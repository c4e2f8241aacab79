"""Temperatures whose thermometer is noisy: what the box had, which changes slowly.

Where the noise is left in, readings are sorted among those of another temperature. Where many were
taken at one temperature (a hold) they spill over into the bins beside it, which no standard error
knows of: errors in variables.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation import polynomial
from agonic.maths.estimation.filters.whittaker import FEWEST, smooth
from agonic.maths.estimation.noise.residuals import MAD_TO_SD

_ROUNDED = 0.25
"""Share of the error that is left which all stations have in common: what smoothing makes of the
corners of the programme, averaged over `_CORNER_C`."""
_CORNER_C = 2.0
CALM_C = 0.03
"""Noise of a thermometer that is left as it is."""
_GAP = 20.0  # usual steps


class Smoothed(NamedTuple):
    """Temperatures (n,), the noise of the thermometer, and what is left of it, °C."""

    temperature: Array
    noise_C: float
    left_C: float


def measure_noise(temperature: Array) -> float:
    """The noise of a thermometer from reading to reading, °C, by second differences."""
    if len(temperature) < 3:
        return 0.0
    return float(MAD_TO_SD * np.median(np.abs(np.diff(temperature, 2))) / np.sqrt(6.0))


def smooth_thermometer(temperature: Array, time: Array | None = None) -> Smoothed:
    """Temperatures with the noise of the thermometer taken off, where it has more than `CALM_C`.

    Whittaker's smoother between gaps of the clock: as smooth as the readings allow, corners of the
    programme included.
    """
    noise = measure_noise(temperature)
    if noise < CALM_C:
        return Smoothed(temperature, noise, noise)
    calmed, variance = temperature.copy(), 0.0
    for start, stop in pairwise(_find_edges(temperature, time)):
        if stop - start < FEWEST:
            variance += (stop - start) * noise**2
            continue
        part = temperature[start:stop]
        calmed[start:stop], freedom = smooth(part)
        variance += (stop - start) * noise**2 * freedom
    return Smoothed(calmed, noise, float(np.sqrt(variance / len(temperature))))


def propagate_error(bias: Array, half_range_C: float, left_C: float) -> Array:
    """What temperatures that are off alike at all stations add to the covariance of a bias.

    Stretches of `_CORNER_C` are off independently of each other, each moving the bias there by its
    slope; the polynomials follow by least squares.

    Parameters: coefficients (3, p) in powers of x = −1…1 with half of the range, and what is left
    of the thermometer's noise. Returns (3 p, 3 p), the powers of an axis together.
    """
    degree = bias.shape[1] - 1
    x = np.linspace(-1.0, 1.0, max(round(2 * half_range_C / _CORNER_C), degree + 2))
    slope = polynomial.derivative(x, degree) @ bias.T / half_range_C
    follow = np.linalg.pinv(polynomial.powers(x, degree))
    moved = np.einsum("pn,na->apn", follow, slope * (_ROUNDED * left_C)).reshape(bias.size, -1)
    return np.asarray(moved @ moved.T)


def _find_edges(temperature: Array, time: Array | None) -> list[int]:
    """Where stretches without a gap begin and end."""
    if time is None:
        return [0, len(temperature)]
    steps = np.diff(time)
    breaks = np.flatnonzero(steps > _GAP * np.median(steps)) + 1
    return [0, *breaks.tolist(), len(temperature)]
