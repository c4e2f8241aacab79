"""How far the tilt is off, by the dip of the measured field less the dip that is expected.

A tilt that is off by ε about a level axis shows the field at a dip that is off by the part of ε in
the magnetic meridian. The part across it turns the heading by ε tan dip and does not show. Over
headings and time both are as large, so the scatter of the dip tells that of the tilt:

    dip − expected = ε_meridian + errors of calibration + noise,   σ² = σ_tilt² + σ_cal² + σ_noise²

It lowers what was assumed or felt of the tilt, where the headings show both of its axes, and raises
what was assumed, felt or stated wherever the dip scatters by more.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.calibration.setup import Compass, Setup
from agonic.headings.acceleration import ROWS
from agonic.headings.attitude import LEVEL, Attitude, select_rows
from agonic.headings.compass_heading import Readings
from agonic.headings.expected_field import Surroundings
from agonic.headings.maths.lean import CLIP, FEWEST
from agonic.headings.propagation import apply_steps, list_steps, propagate
from agonic.health.finding import figure
from agonic.maths.estimation.noise.residuals import MAD_TO_SD, correlation_length
from agonic.maths.rotations import tilt as kernel
from agonic.units import RAW

AVERAGED_S = 1.0
"""Residuals within it are averaged."""
LOCAL_S = 60.0
"""The scatter is taken over so long about each row too: some vehicles turn at times only."""
PRIOR = 2.0
"""Independent residuals that the error of the tilt, as it was assumed or felt, counts for."""
CAUTION = 4.0
"""The same where the residuals are smaller."""
LEAST_SD = np.radians(0.1)
"""No tilt is taken to be better known than this, unless stated."""


class DipResiduals(NamedTuple):
    """Of the rows (k,) of a log: dip less expected, its variance by noise, and by the calibration.

    In rad and rad²; `north` is the square of the cosine of the magnetic heading.
    """

    rows: Index
    residual: Array
    noise: Array
    calibration: Array
    north: Array


def refine_tilt_sd(
    attitude: Attitude,
    compasses: list[tuple[Compass, Readings]],
    around: Surroundings,
    setup: Setup,
    time: Array | None,
) -> Attitude:
    """The attitude with standard errors that the dip of the field bears out; the compass whose dip
    scatters least tells."""
    exact = attitude.source == "log" and not attitude.roll_sd.any()
    if attitude.source == LEVEL or exact:
        return attitude
    seen = [compute_dip_residuals(c, r, attitude, around, setup) for c, r in compasses]
    told = [one for one in seen if one is not None]
    if not told:
        return attitude
    best = min(told, key=lambda one: _scatter(one.residual))
    local = time is not None and len(time) == len(attitude.tilt.cos_roll)
    if time is not None and local:
        best = _average(best, time)
    followed = _follow(attitude, best, _Within(None))
    if time is not None and local:
        followed = _follow(followed, best, _Within(time[best.rows]))
    if np.median(followed.variance) <= 2.0 * np.median(attitude.variance):
        return followed
    scattered = float(np.degrees(_scatter(best.residual)))
    said = f"the dip of the field scatters by {figure(scattered)}°, and perhaps the tilt as well"
    return replace(followed, notes=(*followed.notes, said))


def compute_dip_residuals(
    compass: Compass, readings: Readings, attitude: Attitude, around: Surroundings, setup: Setup
) -> DipResiduals | None:
    """The residuals of one compass, or `None` where too few rows can be compared.

    Rows whose magnitude is off by more than the limit are disturbed and left out; an error of the
    tilt does not change the magnitude.
    """
    n = len(readings.raw)
    rows = np.unique(np.linspace(0, n - 1, min(n, ROWS)).round().astype(np.intp))
    rows = rows[~readings.missing[rows]]
    readings, steps = readings.subset(rows), list_steps(compass.calibration)
    values = apply_steps(steps, readings.raw, readings.columns)
    tilt = attitude.select_tilt(rows)
    with np.errstate(divide="ignore", invalid="ignore"):
        turned = kernel.heading_with_derivatives(values[-1], tilt, attitude.order)
        # ∂dip/∂field (3, k), rad per unit: (h d − (z/h)(b − z d))/|b|²
        down = kernel.compute_down(tilt, attitude.order)
        h, z = turned.horizontal[:, None], turned.vertical[:, None]
        gradient = ((h * down - (z / h) * (values[-1] - z * down)) / (h * h + z * z)).T
    calibration, noise, _ = propagate(steps, values, readings.columns, gradient)
    if readings.averaged is not None:
        noise = noise * readings.averaged
    kept = np.asarray(np.isfinite(gradient).all(axis=0))
    if kept.sum() < FEWEST:
        return None
    share, dip = around.compare(turned.horizontal, turned.vertical, kept, rows)
    if around.horizontal is not None and compass.calibration.unit_out != RAW:
        kept &= np.abs(share - 1) <= setup.magnitude_limit
    if kept.sum() < FEWEST:
        return None
    north = np.cos(np.radians(turned.heading_deg[kept])) ** 2
    return DipResiduals(rows[kept], dip[kept], noise[kept], calibration[kept], north)


def _average(seen: DipResiduals, time: Array) -> DipResiduals:
    """The residuals of each second: its noise averages out, the tilt's error lasts."""
    second = np.floor((time[seen.rows] - time[0]) / AVERAGED_S)
    start = np.flatnonzero(np.concatenate([[True], np.diff(second) > 0]))
    if len(start) < FEWEST:
        return seen
    count = np.diff(np.append(start, len(second)))
    residual, noise, calibration, north = (np.add.reduceat(v, start) / count for v in seen[1:])
    rows = seen.rows[start + count // 2]
    return DipResiduals(rows, residual, noise / count, calibration, north)


class _Within:
    """Means of residuals at times (k,) over those within `LOCAL_S` of each; without times over all
    of them."""

    def __init__(self, time: Array | None) -> None:
        self.ends = None
        if time is not None:
            after = np.searchsorted(time, time + LOCAL_S / 2, side="right")
            self.ends = np.searchsorted(time, time - LOCAL_S / 2), after

    def count(self, n: int) -> Array:
        """How many they are."""
        return np.asarray(n if self.ends is None else self.ends[1] - self.ends[0], np.float64)

    def mean(self, values: Array) -> Array:
        """The means."""
        if self.ends is None:
            return np.asarray(np.mean(values))
        total = np.concatenate([[0.0], np.cumsum(values)])
        return np.asarray((total[self.ends[1]] - total[self.ends[0]]) / self.count(len(values)))


def _follow(attitude: Attitude, seen: DipResiduals, within: _Within) -> Attitude:
    """The tilt's variances as large as the dip shows, over the whole log or about each row.

    A dip that scatters by more than all errors together raises the tilt's; one that scatters by
    less lowers it, by what is left without the noise and as far as the headings show both axes of
    the vehicle: an error along one of them hides on half of all headings.
    """
    tilt = select_rows(attitude.variance, seen.rows)
    total = tilt + seen.noise + seen.calibration + 1e-12
    z = seen.residual / np.sqrt(total)
    clipped = _clip(z)
    square = clipped**2
    mean = within.mean
    independent = within.count(len(z)) / correlation_length(clipped, np.ones(len(z)))
    more = (PRIOR + independent * mean(square)) / (PRIOR + independent)
    share = mean(tilt / total)
    less = np.maximum(mean(z**2 - seen.noise / total), 0.0) / np.maximum(share, 1e-9)
    shown = 2 * np.minimum(mean(seen.north), 1.0 - mean(seen.north))
    shown = np.where(shown > 0.05, shown, 0.0)  # less shows nothing of an axis
    telling = independent * shown * share**2
    less = np.minimum(less / np.maximum(shown, 1e-3), 1.0)
    less = (CAUTION + telling * less) / (CAUTION + telling)
    n = len(attitude.tilt.cos_roll)
    less = np.where(more > 1.0, 1.0, less)
    added, less = (
        np.interp(np.arange(n), seen.rows, each) if each.ndim else each  # one for all rows
        for each in (np.maximum(more - 1.0, 0.0) * total, less)
    )
    across = attitude.tilt.cos_pitch if attitude.order == "roll-pitch" else np.ones(1)
    parts = []
    for sd, lean in ((attitude.roll_sd, np.maximum(across, 1e-3)), (attitude.pitch_sd, 1.0)):
        least = np.minimum(sd, np.maximum(attitude.stated_sd, LEAST_SD) / lean)
        parts.append(np.sqrt(np.maximum(less * sd**2, least**2) + added))
    return replace(attitude, roll_sd=parts[0], pitch_sd=parts[1])


def _clip(values: Array) -> Array:
    """Values of which those beyond `CLIP` robust standard deviations are clipped."""
    limit = CLIP * MAD_TO_SD * float(np.median(np.abs(values)))
    return np.clip(values, -limit, limit)


def _scatter(values: Array) -> float:
    """Root mean square about zero of values as they are clipped."""
    return float(np.sqrt(np.mean(_clip(values) ** 2)))
