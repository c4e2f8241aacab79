"""How far the tilt is off, by the dip of the measured field less the dip that is expected.

A tilt that is off by ε about a level axis shows the field at a dip that is off by the part of ε in
the magnetic meridian. The part across it turns the heading by ε tan dip and does not show. Over
headings and time both are as large, so the scatter of the dip tells that of the tilt:

    dip − expected = ε_meridian + errors of calibration + noise,   σ² = σ_tilt² + σ_cal² + σ_noise²

It lowers what was only assumed of the tilt, where the headings show both of its axes, and raises
what was assumed, felt or stated wherever the dip scatters by more.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.calibration.setup import Compass, Setup
from agonic.headings.attitude import LEVEL, Attitude
from agonic.headings.compass_heading import Readings
from agonic.headings.expected_field import Surroundings
from agonic.headings.propagation import apply_steps, list_steps, propagate
from agonic.health.finding import figure
from agonic.maths.estimation.leastsq import MAD_TO_SD, correlation_length
from agonic.maths.rotations import tilt as kernel
from agonic.units import RAW

ROWS = 20_000
"""Rows, spread evenly over the log, whose dip is looked at."""
FEWEST = 30
"""Rows that a scatter is taken from at least."""
BLOCK_S = 60.0
"""The scatter is taken over each stretch of this duration too: some vehicles turn at times only."""
PRIOR = 4.0
"""Independent residuals that the assumed error of the tilt counts for."""
LEAST_SD = np.radians(0.1)
"""No recorded tilt is taken to be better known than this, unless stated."""
CLIP = 3.0
"""Residuals further out than so many standard deviations count as these: a magnet is no tilt."""


class DipResiduals(NamedTuple):
    """Of the rows (k,) of a log: dip less expected, its variance by noise, and by the calibration.

    In rad and rad². `spread` is the mean square of the cosine or sine of the magnetic heading,
    whichever is smaller: 0.5 where all headings were steered, 0 where one was. `known` where the
    expected dip is that of the place and not the log's own.
    """

    rows: Index
    residual: Array
    noise: Array
    calibration: Array
    spread: float
    known: bool


def refine_tilt_sd(
    attitude: Attitude,
    compasses: list[tuple[Compass, Readings]],
    around: Surroundings,
    setup: Setup,
    time: Array | None,
) -> Attitude:
    """The attitude with standard errors that the dip of the field bears out.

    Parameters: `compasses` and their readings (n,); the one whose dip scatters least tells.
    `time` (n,) in seconds, or `None`.
    """
    stated_exact = attitude.source == "log" and not attitude.roll_sd.any()
    if attitude.source == LEVEL or stated_exact:
        return attitude
    seen = [compute_dip_residuals(c, r, attitude, around, setup) for c, r in compasses]
    told = [one for one in seen if one is not None]
    if not told:
        return attitude
    best = min(told, key=lambda one: _scatter(one.residual))
    return _raised(_lowered(attitude, best), best, time)


def compute_dip_residuals(
    compass: Compass, readings: Readings, attitude: Attitude, around: Surroundings, setup: Setup
) -> DipResiduals | None:
    """The residuals of one compass, or `None` where too few rows can be compared.

    Rows whose magnitude is off by more than the limit are disturbed and left out; an error of the
    tilt does not change the magnitude.
    """
    n = len(readings.raw)
    rows = np.unique(np.linspace(0, n - 1, min(n, ROWS)).round().astype(np.intp))
    if readings.missing is not None:
        rows = rows[~readings.missing[rows]]
    columns = {name: values[rows] for name, values in readings.columns.items()}
    steps = list_steps(compass.calibration)
    values = apply_steps(steps, readings.raw[rows], columns)
    tilt = kernel.Tilt(*(_at(part, rows) for part in attitude.tilt))
    with np.errstate(divide="ignore", invalid="ignore"):
        turned = kernel.heading_with_derivatives(values[-1], tilt, attitude.order)
        size = np.hypot(turned.horizontal, turned.vertical)
        gradient = _gradient(values[-1], kernel.compute_down(tilt, attitude.order), turned)
    calibration, noise = propagate(steps, values, columns, gradient)
    if readings.averaged is not None:
        noise = noise * readings.averaged[rows]
    dip = np.arctan2(turned.vertical, turned.horizontal)
    kept = np.isfinite(dip) & np.isfinite(gradient).all(axis=0)
    known = around.horizontal is not None and around.vertical is not None
    if known:
        h, z = (_at(part, rows) for part in (around.horizontal, around.vertical))
        dip = dip - np.arctan2(z, h)
        if compass.calibration.unit_out != RAW:
            kept &= np.abs(size / np.hypot(h, z) - 1) <= setup.magnitude_limit
    if kept.sum() < FEWEST:
        return None
    if not known:
        dip = dip - np.median(dip[kept])
    heading = np.radians(turned.heading_deg[kept])
    spread = min(float(np.mean(np.cos(heading) ** 2)), float(np.mean(np.sin(heading) ** 2)))
    return DipResiduals(rows[kept], dip[kept], noise[kept], calibration[kept], spread, known)


def _gradient(field: Array, down: Array, turned: kernel.HeadingDerivatives) -> Array:
    """∂dip/∂field (3, k), rad per unit: (h d − (z/h)(b − z d))/|b|²."""
    h, z = turned.horizontal[:, None], turned.vertical[:, None]
    return np.asarray(((h * down - (z / h) * (field - z * down)) / (h * h + z * z)).T)


def _lowered(attitude: Attitude, seen: DipResiduals) -> Attitude:
    """What was assumed of a recorded tilt, or of an accelerometer at rest, replaced by what shows.

    An error along one axis of the vehicle shows on half of all headings; on those that hide it,
    nothing is lowered.
    """
    assumed = attitude.assumed_sd**2
    if not (seen.known and assumed > 0.0 and seen.spread > 0.0):
        return attitude
    shown = max(_scatter(seen.residual) ** 2 - float(np.median(seen.noise)), 0.0)
    share = min(shown / assumed / (2 * seen.spread), 1.0)
    independent = _count_independent(seen.residual)
    share = (PRIOR + independent * share) / (PRIOR + independent)
    less = assumed - max(assumed * share, min(assumed, LEAST_SD**2))
    across = attitude.tilt.cos_pitch if attitude.source != "log" else np.ones(1)
    roll = attitude.roll_sd**2 - less / np.maximum(across, 1e-3) ** 2
    return replace(
        attitude,
        roll_sd=np.sqrt(np.maximum(roll, LEAST_SD**2)),
        pitch_sd=np.sqrt(np.maximum(attitude.pitch_sd**2 - less, LEAST_SD**2)),
    )


def _raised(attitude: Attitude, seen: DipResiduals, time: Array | None) -> Attitude:
    """Where the dip scatters by more than is stated, over the log or a block of it, the tilt's."""
    variance = _at(attitude.variance, seen.rows)
    total = variance + seen.noise + seen.calibration + 1e-12
    z = seen.residual / np.sqrt(total)
    length = len(z) / _count_independent(z)
    n = len(attitude.tilt.cos_roll)
    factor = np.full(n, _compute_excess(z, length))
    if time is not None and len(time) == n:
        block = ((time - time[0]) // BLOCK_S).astype(np.intp)
        at = block[seen.rows]
        for one in np.unique(at):
            first, last = np.searchsorted(at, (one, one + 1))
            if last - first >= FEWEST:
                excess = _compute_excess(z[first:last], length)
                factor[block == one] = np.maximum(factor[block == one], excess)
    if not (factor > 1.0).any():
        return attitude
    more = (factor - 1.0) * np.interp(np.arange(n), seen.rows, total)
    scattered = float(np.degrees(_scatter(seen.residual)))
    said = f"the dip of the field scatters by {figure(scattered)}°, so the tilt counts for as much"
    return replace(
        attitude,
        roll_sd=np.sqrt(attitude.roll_sd**2 + more),
        pitch_sd=np.sqrt(attitude.pitch_sd**2 + more),
        notes=(*attitude.notes, said),
    )


def _compute_excess(z: Array, length: float) -> float:
    """The mean square of z where it exceeds 1 by three standard errors, else 1."""
    independent = max(len(z) / length, 1.0)
    square = _scatter(z) ** 2
    return square if square > 1.0 + CLIP * np.sqrt(2.0 / independent) else 1.0


def _scatter(values: Array) -> float:
    """Root mean square about zero, values beyond `CLIP` robust standard deviations clipped."""
    limit = CLIP * MAD_TO_SD * float(np.median(np.abs(values)))
    return float(np.sqrt(np.mean(np.minimum(values**2, limit**2))))


def _count_independent(values: Array) -> float:
    """How many independent residuals these stand for."""
    limit = CLIP * MAD_TO_SD * float(np.median(np.abs(values)))
    return len(values) / correlation_length(np.clip(values, -limit, limit), np.ones(len(values)))


def _at(values: Array | None, rows: Index) -> Array:
    """The rows of a column, or the one value that holds for all."""
    assert values is not None
    return values if len(values) == 1 else values[rows]
