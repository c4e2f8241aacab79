"""What a fit beside accelerometer and gyro rests on: the dip, known or not, and gravity's sign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.attitude.known_heading import check_azimuth
from agonic.calibration.base import correct_field
from agonic.fit import Fit
from agonic.health.evidence import HEADING_DOUBTFUL_DEG
from agonic.health.finding import Fact, Finding, Limit, Told, find_first
from agonic.inertial.problem import INCLINATION_SD, Settings
from agonic.inertial.start import FOUND, SLOW_M_S, Solved, find_field
from agonic.maths.estimation.noise.residuals import robust_scale
from agonic.maths.rotations.tilt import down_from_force
from agonic.maths.rotations.vectors import skew
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.units import STANDARD_GRAVITY_M_S2

INCLINATION_DOUBTFUL_DEG = 3.0
WALKING_M_S = 1.0
"""A speed that nobody would call standing."""
WALKS_DEG = 0.5
"""°/√s: no gyro is as noisy; one with a clock off by 0.3 s, or with other axes, seems so."""
OPPOSITE_DEG = 15.0
"""A dip is the opposite of the known one to this, and known one steep enough to tell."""
TURN_ROUND = (
    "reverse that sign: at rest and level, the axis that points down reads −9.8 m/s², and the "
    "one that points north a positive field"
)
SCATTER = 0.35
"""Of the field: a vertical part that scatters by more is not that of the accelerometer's axes."""
MIN_TURNED_ROWS = 50
"""Readings whose median tells a dip."""


def _measure_inclination(_: Fit, solved: Solved) -> Told:
    """How well the log tells the dip that nothing else told. Errors of the tilt make its effect on
    the readings seem smaller, by their share of its variance (regression dilution), and with it the
    vertical intensity Z: dI = dZ/Z · sin 2I/2."""
    if not solved.settings.inclination_free:
        return None
    variance = float(solved.found.solution.covariance[-1, -1])
    level, below = solved.reference.values.mean(axis=0)
    diluted = solved.tilt_noise * abs(float(np.sin(2 * np.arctan2(below, level)))) / 2
    return float(np.degrees(np.hypot(np.sqrt(variance) * solved.sds[-1], diluted)))


def _measure_speed(fit: Fit, solved: Solved) -> Told:
    """What a speed kept in turns, which looks like a lean, makes of a heading. Of a speed v the
    estimate misses C v, C being what the log leaves of the prior's variance, and that leans level
    by ω × C v/g, at the mean rate ω."""
    rate = solved.samples.rotation_rate
    if rate is None or solved.felt.ahead is None or solved.sds[9] > SLOW_M_S:
        return None
    first = len(solved.found.solution.params) - len(solved.sds) + 9
    missed = solved.found.solution.covariance[first : first + 3, first : first + 3]
    steady = rate[solved.usable].mean(axis=0) - solved.errors[3:6]
    lean = skew(steady) @ missed / STANDARD_GRAVITY_M_S2
    steep = abs(np.tan(np.radians(fit.coverage.inclination_deg)))
    off = float(np.degrees(steep * WALKING_M_S * np.linalg.norm(lean, 2)))
    return {"value": off, "speed": WALKING_M_S}


INCLINATION = Fact(
    "inclination",
    _measure_inclination,
    Limit(INCLINATION_DOUBTFUL_DEG),
    "the dip of the field is not known and the log determines it to {value}° only: headings hold "
    "where the vehicle is as level as it was",
    "give the place (--at LAT,LON), or tilt the vehicle by 5° and more while it turns",
)
ONE_RATE = Fact(
    "turned at one rate",
    _measure_speed,
    Limit(HEADING_DOUBTFUL_DEG),
    "it turned at one rate only, so a constant speed in its turns looks like a tilt: at {speed} "
    "m/s headings would be off by up to {value}°",
    "stop for ten seconds between the turns, and turn both ways, fast and slowly",
)
CONTRADICTION = Fact(
    "inertial unit",
    lambda solved: {} if solved.contradictory else None,
    "refuse",
    "accelerometer, gyro and magnetometer contradict one another: no attitude fits all three",
    "check their units, signs, axes and clocks, or calibrate by the magnitude alone (--method "
    "ellipsoid)",
)


def check_gyro(fit: Fit, solved: Solved) -> Finding | None:
    """The finding that the gyro does not turn as the field does. A vehicle that brakes leans the
    vertical that is felt, and with it the azimuth of the field: so the gyro is blamed only where it
    contradicts the joint estimate too, which knows the tilt by the field."""
    if solved.walk_deg < WALKS_DEG:
        return None
    magnitude = fit.calibration.magnitude
    assert magnitude is not None
    radius = 3 * magnitude / float(np.trace(fit.calibration.matrix))
    return check_azimuth(fit.channels, radius, fit.coverage.inclination_deg, felt=True)


def check_gravity(
    fit: Fit, samples: Samples, given: Reference | None, settings: Settings
) -> Finding | None:
    """The finding that the acceleration has the sign of gravity, where a bad fit shows it. Then the
    field seems to dip by as much towards the sky. A dip that was found beside the unit says nothing
    of its sign."""
    bad = fit.verdict == "refused" or any(one.name == "disturbed" for one in fit.findings)
    if given is None or given.values.ndim == 1 or given.source == FOUND or not bad:
        return None
    level, below = given.horizontal_and_vertical(len(samples)).mean(axis=0)
    magnitude = Reference.constant(float(np.hypot(level, below)))
    found, _ = find_field(samples, magnitude, replace(settings, inclination_sd=INCLINATION_SD))
    seen = found.values.mean(axis=0)
    known, dip = np.degrees(np.arctan2([below, seen[1]], [level, seen[0]]))
    return find_first([FELT_OPPOSITE], float(dip), float(known))


def check_felt_dip(fit: Fit, samples: Samples, given: Reference | None) -> Finding | None:
    """The finding that a field calibrated by its magnitude dips towards the sky where it should
    towards the ground, by what the accelerometer feels. The magnitude sees no sign; which of the
    two sensors has the opposite one, nothing tells."""
    known = None if given is None else given.inclination_deg
    if known is None or samples.acceleration is None:
        return None
    field = correct_field(fit.calibration, samples)
    down = down_from_force(samples.acceleration)
    size = np.sqrt((field**2).sum(axis=1))
    below = (field * down).sum(axis=1) / np.where(size > 0, size, np.nan)
    below = below[np.isfinite(below)]
    if len(below) < MIN_TURNED_ROWS or robust_scale(below - np.median(below)) > SCATTER:
        return None
    dip = float(np.degrees(np.arcsin(np.clip(np.median(below), -1.0, 1.0))))
    return find_first([EITHER_OPPOSITE], dip, known)


def _measure_opposite(dip: float, known: float) -> Told:
    """A dip that is the opposite of the known one."""
    opposite = abs(known) >= OPPOSITE_DEG and abs(known + dip) <= OPPOSITE_DEG
    return {"dip": dip, "known": known} if opposite else None


FELT_OPPOSITE = Fact(
    "inertial unit",
    _measure_opposite,
    "refuse",
    "the field seems to dip by {dip}° where it should by {known}°: the acceleration has the "
    "opposite sign",
    TURN_ROUND,
)
EITHER_OPPOSITE = Fact(
    "inertial unit",
    _measure_opposite,
    "check",
    "the field seems to dip by {dip}° where it should by {known}°: acceleration or magnetometer "
    "have the opposite sign",
    TURN_ROUND,
)
