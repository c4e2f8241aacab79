"""`EllipseFit`: the calibration of a two-axis compass, and what speaks for and against it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.ellipse.maths.conic import compute_turns, find_sectors, fit_circle
from agonic.fit import Fit, gather_evidence
from agonic.health import Finding, inspect
from agonic.health.finding import Fact, Limit, Told, find_facts
from agonic.maths.rotations.tilt import down_from_force, roll_pitch_deg, tilt_from_down
from agonic.model.posterior import Posterior
from agonic.model.verdict import examine_beside_terms, judge
from agonic.readable import Shown
from agonic.samples import Samples


@dataclass(frozen=True, kw_only=True, eq=False)
class EllipseFit(Fit):
    """A two-axis compass calibrated, and what the calibration rests on.

    `calibration` has model "ellipse": its bias along z, and the covariance of that, are 0, and its
    gain along z is the mean one.
    `residuals` (n,) are distances from the ellipse in the unit of the readings, `weights` (n,) what
    the robust loss left of each; `noise` the standard deviation of one reading on one axis,
    `correlation` the correlation length in readings; `heading_sd_deg` the standard error of a level
    heading that the calibration makes, rms over all headings, and `shares` what it is made of;
    `spread_before` and `spread_after` that of the magnitude, over its mean; `inclination_deg` the
    dip of the place, None where it is not known.
    """

    samples: Samples
    residuals: Array
    weights: Array
    n: Annotated[int, Shown()]
    noise: Annotated[float, Shown()]
    correlation: Annotated[float, Shown()]
    heading_sd_deg: Annotated[float, Shown()]
    spread_before: Annotated[float, Shown()]
    spread_after: Annotated[float, Shown()]
    inclination_deg: Annotated[float | None, Shown()] = None

    @cached_property
    def sectors(self) -> Index:
        """The readings in each 15° of the circle, (24,), of few readings in each 30°, (12,).

        About the ellipse or the circle of all readings, whichever has seen less: a small ellipse
        can close about the readings of a short arc.
        """
        used = self.samples.field[self.weights > 0, :2]
        about = [(self.bias[:2], self.matrix[:2, :2])]
        size = float(np.abs(used).max()) or 1.0
        about.append((fit_circle(used / size)[:2] * size, np.eye(2)))
        seen = [find_sectors((used - bias) @ matrix) for bias, matrix in about]
        return min(seen, key=np.count_nonzero)

    @property
    def seen_deg(self) -> float:
        """How much of the circle was seen."""
        return float(np.count_nonzero(self.sectors)) * 360.0 / len(self.sectors)


LIKELY_DIP_DEG = 65.0
"""The dip where the place is not known."""
TURN = "turn the vehicle level through the whole circle, slowly, once each way"


def examine_circle(
    fit: EllipseFit, usable: Mask, normals: Array, posterior: Posterior | None
) -> tuple[Finding, ...]:
    """The findings of a fit: what was seen of the circle, of its shape, of tilt and of terms. Where
    too little of the circle was seen the numbers say nothing of the rest."""
    axes = 1.0 / np.maximum(np.linalg.eigvalsh(fit.matrix[:2, :2]), 1e-300)
    circle = Circle(
        fit, axes.min() * (fit.calibration.magnitude or 1.0), float(axes.max() / axes.min())
    )
    seen = [*inspect(fit.samples), *find_facts(OF_CIRCLE, circle)]
    if any(one.severity == "refuse" for one in seen):
        return tuple(seen)
    evidence = gather_evidence(
        fit, fit.calibration, fit.samples, fit.samples.field, normals, usable, None
    )
    if posterior is not None:  # of z nothing is asked
        held = posterior.held
        posterior = posterior._replace(held=held._replace(bias_sd=held.bias_sd * [1.0, 1.0, 0.0]))
    examined = examine_beside_terms(evidence, posterior, attitude_aided=True)
    facts = [*seen, *examined, *find_facts(OF_USE, circle)]
    judged = judge(posterior, evidence, facts)
    return (*facts, *(_name_tilt(o) if o.name == "correlated noise" else o for o in judged))


def _name_tilt(correlated: Finding) -> Finding:
    """What mostly makes residuals of a level compass correlated, in words."""
    cause = "tilt, or from something magnetic that moved"
    what = correlated.what.replace("an unknown cause", cause)
    return replace(correlated, what=what, move="record again on level ground, away from iron")


class Circle(NamedTuple):
    """A fit with the shorter half axis of its ellipse, and how often the longer one has it."""

    fit: EllipseFit
    shorter: float
    ratio: float


def _measure_seen(circle: Circle) -> Told:
    return {"value": 360.0 - circle.fit.seen_deg, "seen": circle.fit.seen_deg}


def _measure_gain(circle: Circle) -> Told:
    fit = circle.fit
    gain = float(np.trace(fit.matrix[:2, :2])) / 2
    in_nt = fit.calibration.unit_in == fit.calibration.unit_out and fit.inclination_deg is not None
    return {"value": abs(float(np.log(gain))), "size": 1 / gain} if in_nt else None


def _measure_leak(circle: Circle) -> Told:
    """What roll and pitch, or an accelerometer, say of the tilt while the vehicle turned."""
    tilt_deg = measure_tilt_deg(circle.fit.samples)
    if tilt_deg is None:
        return None
    known = circle.fit.inclination_deg
    dip = LIKELY_DIP_DEG if known is None else abs(known)
    return {"value": tilt_deg * np.tan(np.radians(min(dip, 89.0))), "tilt": tilt_deg, "dip": dip}


def _measure_turns(circle: Circle) -> Told:
    fit = circle.fit
    field = fit.calibration.correct(fit.samples.field)[fit.weights > 0, :2]
    return None if fit.samples.time is None else -min(compute_turns(field))


OF_CIRCLE = (
    Fact(
        "static",
        lambda circle: circle.fit.noise / circle.shorter,
        Limit(refuse=0.2),
        "the readings form a cloud, not a circle: the sensor did not turn, or noise hides it",
        TURN,
    ),
    Fact(
        "coverage",
        _measure_seen,
        Limit(refuse=90.0),  # with less seen, noise bends the ellipse where nothing was
        "only {seen:.0f}° of the circle was seen; needed is 270° at least",
        TURN,
    ),
)
"""What leaves nothing else to say."""
OF_USE = (
    Fact(
        "shape",
        lambda circle: circle.ratio,
        Limit(2.0, 5.0),
        "one axis of the ellipse is {value} times as long as the other",
        "look for iron beside the sensor, and for an axis in another unit",
    ),
    Fact(
        "scale",
        _measure_gain,
        Limit(0.25),
        "the readings have {size} times the horizontal intensity of the place",
        "check the unit, the place, and that the sensor is level in the vehicle",
    ),
    Fact(
        "attitude",
        _measure_leak,
        Limit(1.0),
        "the vehicle tilted by {tilt}° rms while it turned, which turns the heading by {value}° at "
        "a dip of {dip:.0f}°",
        "record again on level ground",
    ),
    Fact(
        "one way",
        _measure_turns,
        Limit(note=-0.25),  # fewer turns the other way tell no heel in turns from iron
        "the vehicle turned one way only: a heel in its turns would look like hard iron",
        "turn once each way where it heels in turns",
    ),
)


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
