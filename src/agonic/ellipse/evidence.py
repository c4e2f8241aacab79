"""What the calibration of a two-axis compass rests on, and what speaks against it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.ellipse.maths.conic import (
    compute_lasting,
    compute_turns,
    find_sectors,
    find_start,
    fit_circle,
    make_matrix,
)
from agonic.ellipse.result import EllipseFit
from agonic.health import Finding, figure
from agonic.maths.equation.affine import ELLIPSE
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import refine
from agonic.maths.rotations.tilt import (
    down_from_force,
    roll_pitch_deg,
    tilt_from_down,
)
from agonic.samples import Samples


class Found(NamedTuple):
    """An ellipse in the unit of the readings, of magnitude one.

    `ellipse` (5,) bias x y and matrix xx yy xy, `covariance` (5, 5) of them; `noise` of a reading
    on an axis; `correlation` in readings; `residuals` and `weights` (n,).
    """

    ellipse: Array
    covariance: Array
    noise: float
    correlation: float
    residuals: Array
    weights: Array


def solve(readings: Array, rounding: float, *, robust: bool = True, seed: int = 0) -> Found:
    """The ellipse that readings (n, 2) lie on, in their unit.

    The same likelihood as of an ellipsoid (distances from the curve, Tukey's loss where a reading
    stands out, errors that last in the covariance), with z nowhere in it.
    """
    centre = np.median(readings, axis=0)
    size = float(np.sqrt(np.mean(np.sum((readings - centre) ** 2, axis=1))))
    points = (readings - centre) / size
    problem = Problem(
        np.column_stack([points, np.zeros(len(points))]),
        np.ones(1),
        ELLIPSE,
        None,
        rounding=rounding / size,
    )
    found = refine(problem, find_start(points, seed), robust)
    scale = np.array([size, size, 1 / size, 1 / size, 1 / size])
    noise = found.noise["magnitude"]
    return Found(
        found.solution.params * scale + np.r_[centre, np.zeros(3)],
        found.solution.covariance * np.outer(scale, scale),
        noise.sd * size,
        noise.correlation,
        found.residuals["magnitude"] * size,
        found.weights,
    )


LEAST_SEEN_DEG = 270.0
"""Of the circle: with less, noise bends the ellipse where nothing was seen."""
LIKELY_DIP_DEG = 65.0
"""The dip where the place is not known."""
LEAK_DEG = 1.0
"""Error of the heading that tilt may make while the vehicle turns."""
LASTING_DEG = 0.5
"""Departure from the ellipse that lasts, as an angle."""
NOISY_DEG = 3.0
CLOUD = 0.2
"""Noise over the shorter half axis of readings that are a cloud, and no circle."""
DOUBTFUL_DEG, UNKNOWN_DEG = 1.0, 5.0
"""Standard errors of the heading to look at, and to refuse."""
LONG, TOO_LONG = 2.0, 5.0
"""One axis of the ellipse over the other."""
OUTLIERS = 0.2
OFF_GAIN = 0.25
ONE_WAY = 0.25
"""Turns one way that are too few to tell a heel in turns from iron."""
MOVED_DEG, MOVED_SDS = 1.0, 4.0

TURN = "turn the vehicle level through the whole circle, slowly, once each way"


def count_sectors(readings: Array, found: Found) -> Index:
    """Readings in each sector of the circle about the ellipse or about the circle of all readings.

    Whichever has seen less: a small ellipse can close about the readings of a short arc.
    """
    used = readings[found.weights > 0]
    about = []
    for ellipse in (found.ellipse, _fit_circle(used)):
        about.append(find_sectors((used - ellipse[:2]) @ make_matrix(ellipse)))
    return min(about, key=np.count_nonzero)


def _fit_circle(readings: Array) -> Array:
    """The circle through readings, in their unit."""
    size = float(np.abs(readings).max()) or 1.0
    a, b, gain, _, _ = fit_circle(readings / size)
    return np.array([a * size, b * size, gain / size, gain / size, 0.0])


def examine(fit: EllipseFit, found: Found) -> Iterator[Finding]:
    """What was seen of the circle, of its shape, of noise and tilt, as findings.

    Where too little of the circle was seen the numbers say nothing of the rest.
    """
    unseen = list(_examine_circle(fit, found))
    yield from unseen
    if unseen:
        return
    yield from _examine_shape(fit, found)
    yield from _examine_errors(fit)
    yield from _examine_tilt(fit)
    yield from _examine_turns(fit)


def _examine_circle(fit: EllipseFit, found: Found) -> Iterator[Finding]:
    shorter = float(1 / max(np.linalg.eigvalsh(make_matrix(found.ellipse))[1], 1e-300))
    if fit.noise > CLOUD * shorter:
        what = "the readings form a cloud, not a circle: the sensor did not turn, or noise hides it"
        yield Finding("static", "refuse", what, TURN)
    if fit.seen_deg < LEAST_SEEN_DEG:
        what = (
            f"only {fit.seen_deg:.0f}° of the circle was seen; needed is {LEAST_SEEN_DEG:.0f}° at "
            "least"
        )
        yield Finding("coverage", "refuse", what, TURN)


def _examine_shape(fit: EllipseFit, found: Found) -> Iterator[Finding]:
    values = np.linalg.eigvalsh(make_matrix(found.ellipse))
    ratio = float(values[1] / values[0]) if values[0] > 0 else np.inf
    if ratio > LONG:
        what = f"one axis of the ellipse is {figure(ratio)} times as long as the other"
        move = "look for iron beside the sensor, and for an axis in another unit"
        yield Finding("shape", "refuse" if ratio > TOO_LONG else "check", what, move)
    if fit.heading_sd_deg > DOUBTFUL_DEG:
        what = f"the calibration leaves the heading uncertain by {figure(fit.heading_sd_deg)}°"
        refused = fit.heading_sd_deg > UNKNOWN_DEG
        yield Finding("uncertainty", "refuse" if refused else "check", what, f"{TURN}, and longer")


def _examine_errors(fit: EllipseFit) -> Iterator[Finding]:
    outliers = float(np.mean(fit.weights == 0))
    if outliers > OUTLIERS:
        what = f"{100 * outliers:.0f} % of the readings are far from the ellipse"
        move = "look for what disturbed them, and leave that part out (--between)"
        yield Finding("outliers", "check", what, move)
    if fit.noise_deg > NOISY_DEG:
        what = f"one reading scatters by {figure(fit.noise_deg)}° of heading"
        yield Finding("noise", "check", what, "look for tilt, vibration and currents")
    lasting = compute_lasting(fit.residuals[fit.weights > 0])
    gain = float(np.trace(fit.matrix[:2, :2])) / 2
    off_deg = float(np.degrees(lasting * gain / (fit.calibration.magnitude or 1.0)))
    if off_deg > LASTING_DEG:
        what = (
            f"the readings depart from the ellipse by {figure(off_deg)}° over longer times than "
            "noise: the vehicle tilted, or something magnetic moved"
        )
        yield Finding("tilt", "check", what, "record again on level ground, away from iron")
    in_nt = fit.calibration.unit_in == fit.calibration.unit_out and fit.inclination_deg is not None
    if in_nt and abs(np.log(gain)) > OFF_GAIN:
        what = f"the readings have {figure(1 / gain)} times the horizontal intensity of the place"
        move = "check the unit, the place, and that the sensor is level in the vehicle"
        yield Finding("scale", "check", what, move)


def _examine_tilt(fit: EllipseFit) -> Iterator[Finding]:
    """What roll and pitch, or an accelerometer, say of the tilt while the vehicle turned."""
    tilt_deg = measure_tilt_deg(fit.samples)
    if tilt_deg is None:
        return
    dip = LIKELY_DIP_DEG if fit.inclination_deg is None else abs(fit.inclination_deg)
    leak = tilt_deg * float(np.tan(np.radians(min(dip, 89.0))))
    if leak > LEAK_DEG:
        what = (
            f"the vehicle tilted by {figure(tilt_deg)}° rms while it turned, which turns the "
            f"heading by {figure(leak)}° at a dip of {dip:.0f}°"
        )
        yield Finding("attitude", "check", what, "record again on level ground")


def measure_tilt_deg(samples: Samples) -> float | None:
    """By how much the tilt changed, rms about its mean and over both axes; None where untold.

    A tilt that stays is that of the sensor in the vehicle, and part of the bias.
    """
    if samples.roll_deg is not None and samples.pitch_deg is not None:
        roll, pitch = samples.roll_deg, samples.pitch_deg
    elif samples.acceleration is not None:
        roll, pitch = roll_pitch_deg(tilt_from_down(down_from_force(samples.acceleration)))
        known = np.isfinite(roll) & np.isfinite(pitch)
        roll, pitch = roll[known], pitch[known]
    else:
        return None
    return float(np.sqrt((roll.var() + pitch.var()) / 2)) if len(roll) else None


def _examine_turns(fit: EllipseFit) -> Iterator[Finding]:
    if fit.samples.time is None:
        return
    field = fit.calibration.correct(fit.samples.field)[fit.weights > 0, :2]
    if min(compute_turns(field)) < ONE_WAY:
        what = "the vehicle turned one way only: a heel in its turns would look like hard iron"
        yield Finding("one way", "note", what, "turn once each way where it heels in turns")


def find_change(first: EllipseFit, second: EllipseFit) -> Finding | None:
    """The finding where two halves of a log, each a whole circle, have another bias."""
    apart = (second.bias - first.bias)[:2]
    spread = (first.covariance + second.covariance)[:2, :2]
    surely = float(np.sqrt(apart @ np.linalg.solve(spread, apart)))
    gain = float(np.trace(first.matrix[:2, :2])) / 2
    size = float(np.hypot(*apart)) * gain / (first.calibration.magnitude or 1.0)
    moved_deg = float(np.degrees(size))
    if surely < MOVED_SDS or moved_deg < MOVED_DEG:
        return None
    what = f"the second half of the log has another bias, which turns headings by {moved_deg:.1f}°"
    move = "keep iron, currents and heel as they are; calibrate a part of it (--between)"
    return Finding("field changed", "check", what, move)


def compute_spread(magnitude: Array) -> float:
    """Standard deviation over the mean."""
    return float(magnitude.std() / magnitude.mean())
