"""What headings that do not come from the magnetometer add to the joint estimate.

With attitudes R to magnetic north, east and down, the axis x of the sensor has v = R x̂ and the
heading ψ = atan2(v₂, v₁). An error δ of the state, R → exp(δ) R, moves it by

    δψ = δ₃ − v₃ (v₁ δ₁ + v₂ δ₂)/(v₁² + v₂²).

All headings of a source share one offset: of its antennas, of the sensor in the vehicle, of the
declination. What is left lasts for seconds in a filter and for minutes in another, so headings are
weighted by what batches of them scatter, and never more than they ask for.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation.loss import tukey
from agonic.maths.estimation.noise.batch_means import FEWEST_BATCHES, measure_correlation
from agonic.maths.estimation.noise.residuals import MAD_TO_SD
from agonic.maths.rotations.track import Sums, Track, sum_rows

STEEPEST = 0.25
"""Square of the level part of the axis x below which it has no heading to speak of."""


class Headings(NamedTuple):
    """Headings (n,) beside magnetic north, rad, their standard deviations (n,), infinite where
    there is none, and that of the offset that they share, rad."""

    angle: Array
    sd: Array
    offset_sd: float


def sum_headings(
    headings: Headings, track: Track, attitudes: Array, params: Array
) -> tuple[Sums, float]:
    """The sums of the headings in units of their standard deviations, outliers down-weighted, and
    the variance of white noise that would scatter their sum as much as they do.

    Parameters: attitudes (n, 3, 3), and all p parameters, the offset last.
    """
    ahead = attitudes[:, :, 0]
    level = ahead[:, 0] ** 2 + ahead[:, 1] ** 2
    rows = np.flatnonzero(np.isfinite(headings.sd) & (level > STEEPEST))
    ahead, sd = ahead[rows], headings.sd[rows]
    offset = headings.offset_sd * params[-1]
    off = np.arctan2(ahead[:, 1], ahead[:, 0]) - headings.angle[rows] - offset
    residuals = np.angle(np.exp(1j * off)) / sd
    usual = float(np.median(np.abs(residuals))) if len(rows) else 0.0
    scale = max(1.0, MAD_TO_SD * usual)
    weights = tukey().weight((residuals / scale) ** 2)
    n = len(rows)
    by_state, by_params = np.zeros((n, 3, 3)), np.zeros((n, 3, len(params)))
    by_state[:, 0, :2] = -ahead[:, 2:] * ahead[:, :2] / level[rows, None]
    by_state[:, 0, 2] = 1.0
    by_state /= sd[:, None, None]
    by_params[:, 0, -1] = -headings.offset_sd / sd
    left = np.stack([residuals, np.zeros(n), np.zeros(n)], axis=1)
    part = track._replace(interval=track.interval[rows], share=track.share[rows])
    return sum_rows(part, left, by_state, by_params, weights), _scatter(weights * residuals)


def _scatter(scores: Array) -> float:
    """The variance of white noise that adds up to as much as the scores (n,), one and more."""
    if len(scores) < FEWEST_BATCHES:
        return 1.0
    white = len(scores) * np.eye(1)
    return measure_correlation(scores[:, None], white)
