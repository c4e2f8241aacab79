"""What errors that all rows share add to a compass, and how much disturbs it at each moment."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d

from agonic.arrays import Array, Index, Mask
from agonic.headings.attitude import RECORDED_SD_DEG, Attitude
from agonic.headings.compass_heading import find_latency_sd
from agonic.headings.expected_field import Surroundings
from agonic.headings.maths.lean import find_lean_covariance
from agonic.headings.maths.offset import GYRO
from agonic.headings.propagation import apply_steps, list_steps, propagate_parts
from agonic.headings.rows import RowHeadings
from agonic.headings.smoothing.moments import Moments
from agonic.maths.rotations import tilt as kernel
from agonic.maths.rotations.deviation import slope
from agonic.maths.rotations.low_pass import low_pass

STEEPEST = 10.0
"""Tangent of the dip that is reckoned with at most."""


def list_shared_errors(by_row: RowHeadings, rate: Array, rows: Index) -> tuple[Array, Array]:
    """What errors that the rows (N,) of a compass share, and those of the gyro, do to the heading:
    (N, k), and that of the delay (N, 1), radians for one standard deviation of each.

    A field at rest turns in the sensor by −ω × b.
    """
    attitude, tilt = by_row.tilt, by_row.tilt.select_tilt(rows)
    columns, delay = [np.zeros((len(rows), GYRO))], np.zeros(len(rows))
    for k, one in enumerate(by_row.compasses):
        steps, readings = list_steps(one.compass.calibration), one.readings.subset(rows)
        values = apply_steps(steps, readings.raw, readings.columns)
        with np.errstate(divide="ignore", invalid="ignore"):
            turned = kernel.heading_with_derivatives(values[-1], tilt, attitude.order)
        gradient = turned.by_field
        if one.compass.deviation is not None:
            level = np.append(one.compass.deviation.coefficients, np.zeros(4))
            gradient = gradient * (1 + slope(level, turned.heading_deg, 0.0, 0.0))
        # of the rows that are taken from this compass
        gradient = np.where(np.isfinite(gradient) & (by_row.used[rows] == k), gradient, 0.0)
        parts, _ = propagate_parts(steps, values, readings.columns, gradient)
        columns += [part.T for part in parts]
        turn = np.cross(rate[rows], values[-1])
        delay += find_latency_sd(one.compass) * np.einsum("in,ni->n", gradient, turn)
    return np.hstack(columns), delay[:, None]


def follow_axes(axes: Array, moments: Moments, settling_s: float) -> Array:
    """How a sensor's lean in body axes turns up in the tilt: `axes` (N, 3, 3), body to magnetic
    north, east and down, as a filter that settles in so long feels them; 0 without."""
    if not settling_s:
        return axes
    parts = zip(np.split(axes, moments.cuts), np.split(moments.time, moments.cuts), strict=True)
    felt = (
        low_pass(own, float(np.median(np.diff(time))), settling_s) if len(time) > 3 else own
        for own, time in parts
    )
    return np.concatenate(list(felt))


def find_lean_errors(
    columns: Array,
    lean: Array,
    variance: Array,
    parts: tuple[Array, Array],
    around: Surroundings,
    attitude: Attitude,
    moments: Moments,
) -> tuple[Array, float]:
    """What a lean of the tilt's sensor in body axes, as the dip shows it, adds to the compass,
    (N, 3), and by how far other errors of the tilt turn it, rad.

    An accelerometer's bias leans the vertical by ⟨R b⟩/g, which turns the field by as much across
    times the tangent of the dip; a recorded tilt leans with the body. `columns` (N, k) are what
    errors of the calibration add to the compass, whose `variance` (N,) is infinite where it tells
    nothing; `parts` the level and the vertical one of the field (n,).
    """
    rows = moments.rows[moments.middle]
    level, below = (part[rows] for part in parts)
    _, off = around.compare(level, below, np.isfinite(level + below), rows)
    usual = np.nanmedian(np.abs(parts[1] / np.maximum(parts[0], 1e-9)))
    other = float(np.sqrt(np.mean((columns**2).sum(axis=1))) / np.hypot(1.0, usual))
    good = np.isfinite(variance) & np.isfinite(off)
    # how far it leans as stated or assumed, or as the dip shows
    stated = attitude.stated_sd or float(np.radians(RECORDED_SD_DEG))
    sd = min(float(np.sqrt(np.nanmedian(attitude.variance))), stated)
    covariance = find_lean_covariance(moments.time, off, lean[:, 0], good, sd, other)
    steep = below / np.maximum(level, 1e-9)
    across = np.clip(steep, -STEEPEST, STEEPEST)[:, None] * lean[:, 1]
    felt = float(np.nanmedian(attitude.variance)) - float(np.trace(covariance)) / 3.0
    by_tilt = float(np.sqrt(max(felt, 0.0)) * np.nanmedian(np.abs(steep)))
    return np.nan_to_num(across) @ np.linalg.cholesky(covariance), by_tilt


def measure_disturbance(
    horizontal: Array, vertical: Array, sound: Mask, around: Surroundings, moments: Moments
) -> Array:
    """By how much the field is off at each moment, where it shows, as a relative variance (N,).

    Magnitude and dip show two of three directions; across, it turns the compass unseen.
    """
    h, z = horizontal[moments.rows], vertical[moments.rows]
    good = sound[moments.rows]
    share, steeper = around.compare(h, z, good, moments.rows)
    usual = np.median(share[good])
    share = share if abs(float(usual) - 1.0) < 0.5 else share / usual  # else in another unit
    off = np.stack([share - 1.0, steeper], axis=1)
    told = moments.add(good.astype(np.float64))
    mean = moments.add(np.where(good[:, None], off, 0.0)) / np.maximum(told, 1.0)[:, None]
    square = (mean**2).sum(axis=1)
    width = max(round(2.0 / float(np.median(np.diff(moments.time)))), 1)
    there = uniform_filter1d((told > 0).astype(np.float64), width, mode="nearest")
    square = uniform_filter1d(square, width, mode="nearest") / np.maximum(there, 1e-9)
    # deviations of the field below this tell nothing
    square = np.where(there > 1e-9, square, 0.0) + np.radians(0.3) ** 2
    return np.asarray(square / np.mean(square[told > 0]))
