"""What speaks for and against the calibration of a two-axis compass."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from agonic.arrays import Array, Mask
from agonic.coverage import Coverage
from agonic.ellipse.maths.conic import compute_turns
from agonic.ellipse.result import EllipseFit
from agonic.fit import UNKNOWNS
from agonic.health import Evidence, Finding, examine, figure, inspect
from agonic.maths.rotations.tilt import down_from_force, roll_pitch_deg, tilt_from_down
from agonic.model.posterior import Posterior
from agonic.model.verdict import judge, shows_changes
from agonic.samples import Samples

LEAST_SEEN_DEG = 270.0
"""Of the circle: with less, noise bends the ellipse where nothing was seen."""
LIKELY_DIP_DEG = 65.0
"""The dip where the place is not known."""
LEAK_DEG = 1.0
"""Error of the heading that tilt may make while the vehicle turns."""
CLOUD = 0.2
"""Noise over the shorter half axis of readings that are a cloud, and no circle."""
LONG, TOO_LONG = 2.0, 5.0
"""One axis of the ellipse over the other."""
OFF_GAIN = 0.25
ONE_WAY = 0.25
"""Turns one way that are too few to tell a heel in turns from iron."""

TURN = "turn the vehicle level through the whole circle, slowly, once each way"


def examine_circle(
    fit: EllipseFit, usable: Mask, normals: Array, posterior: Posterior | None, coverage: Coverage
) -> Iterator[Finding | None]:
    """What was seen of the circle, of its shape, of tilt and of terms, as findings.

    Where too little of the circle was seen the numbers say nothing of the rest. Parameters:
    `usable` rows (n,), `normals` (n, 3) of the ellipse at the readings.
    """
    axes = 1.0 / np.maximum(np.linalg.eigvalsh(fit.matrix[:2, :2]), 1e-300)
    shorter, longer = axes.min() * (fit.calibration.magnitude or 1.0), axes.max()
    seen = [*inspect(fit.samples), *_examine_seen(fit, float(shorter))]
    yield from seen
    if any(one.severity == "refuse" for one in seen):
        return
    gain = float(np.trace(fit.matrix[:2, :2])) / 2
    evidence = Evidence(
        readings=fit.samples.field[usable],
        time=None if fit.samples.time is None else fit.samples.time[usable],
        residuals=fit.residuals[usable],
        weights=fit.weights[usable],
        normals=normals[usable],
        bias=fit.bias,
        shape=fit.matrix / gain,
        radius=(fit.calibration.magnitude or 1.0) / gain,
        noise=fit.noise,
        coverage=coverage,
        unknowns=UNKNOWNS["ellipse"],
        unit=fit.calibration.unit_in,
    )
    left = None
    if posterior is not None:  # of z nothing is asked
        left, held = posterior.left_without_steps, posterior.held
        posterior = posterior._replace(held=held._replace(bias_sd=held.bias_sd * [1.0, 1.0, 0.0]))
    facts = [*seen, *examine(evidence, shows_changes(posterior), left, attitude_aided=True)]
    facts += [one for one in _examine_use(fit, gain, float(longer / axes.min())) if one is not None]
    yield from facts[len(seen) :]
    at = (evidence.unit, evidence.radius, evidence.time)
    for one in judge(posterior, coverage, *at, facts):
        yield _name_tilt(one) if one.name == "correlated noise" else one


def _name_tilt(correlated: Finding) -> Finding:
    """What mostly makes residuals of a level compass correlated, in words."""
    cause = "tilt, or from something magnetic that moved"
    what = correlated.what.replace("an unknown cause", cause)
    return replace(correlated, what=what, move="record again on level ground, away from iron")


def _examine_seen(fit: EllipseFit, shorter: float) -> Iterator[Finding]:
    if fit.noise > CLOUD * shorter:
        what = "the readings form a cloud, not a circle: the sensor did not turn, or noise hides it"
        yield Finding("static", "refuse", what, TURN)
    if fit.seen_deg < LEAST_SEEN_DEG:
        what = (
            f"only {fit.seen_deg:.0f}° of the circle was seen; needed is {LEAST_SEEN_DEG:.0f}° at "
            "least"
        )
        yield Finding("coverage", "refuse", what, TURN)


def _examine_use(fit: EllipseFit, gain: float, ratio: float) -> Iterator[Finding | None]:
    """What is known of the shape of the ellipse, its size, tilt, and turns."""
    if ratio > LONG:
        what = f"one axis of the ellipse is {figure(ratio)} times as long as the other"
        move = "look for iron beside the sensor, and for an axis in another unit"
        yield Finding("shape", "refuse" if ratio > TOO_LONG else "check", what, move)
    in_nt = fit.calibration.unit_in == fit.calibration.unit_out and fit.inclination_deg is not None
    if in_nt and abs(np.log(gain)) > OFF_GAIN:
        what = f"the readings have {figure(1 / gain)} times the horizontal intensity of the place"
        move = "check the unit, the place, and that the sensor is level in the vehicle"
        yield Finding("scale", "check", what, move)
    yield _examine_tilt(fit)
    field = fit.calibration.correct(fit.samples.field)[fit.weights > 0, :2]
    if fit.samples.time is not None and min(compute_turns(field)) < ONE_WAY:
        what = "the vehicle turned one way only: a heel in its turns would look like hard iron"
        yield Finding("one way", "note", what, "turn once each way where it heels in turns")


def _examine_tilt(fit: EllipseFit) -> Finding | None:
    """What roll and pitch, or an accelerometer, say of the tilt while the vehicle turned."""
    tilt_deg = measure_tilt_deg(fit.samples)
    if tilt_deg is None:
        return None
    dip = LIKELY_DIP_DEG if fit.inclination_deg is None else abs(fit.inclination_deg)
    leak = tilt_deg * float(np.tan(np.radians(min(dip, 89.0))))
    if leak < LEAK_DEG:
        return None
    what = (
        f"the vehicle tilted by {figure(tilt_deg)}° rms while it turned, which turns the "
        f"heading by {figure(leak)}° at a dip of {dip:.0f}°"
    )
    return Finding("attitude", "check", what, "record again on level ground")


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
