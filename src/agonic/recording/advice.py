"""Advice adapted to the recording: nobody can tilt a satellite, an observatory or the Earth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from agonic.fit import Fit
from agonic.health import Finding, sort_findings
from agonic.health.finding import NOT_READ
from agonic.maths.one_pass import median
from agonic.reference import Reference
from agonic.samples import Samples

EARTH_RADIUS_M = 6_371_000.0
SPACE_ALTITUDE_M = 100_000.0
SPACE_SPEED_M_S = 3000.0
STANDING_S = 1800.0
"""A sensor that is not turned for longer than this is mounted where it is."""
TURNING = ("static", "plane", "small tilt", "coverage", "few orientations")
"""Findings that ask somebody to turn the sensor."""
LEVEL_PAGE = "docs/jobs/calibrate-what-cannot-be-turned-over.md"
"""The page of vehicles that stay level."""
NORMALISED = "normalised"
"""Readings that hold directions only: what else a fit to them finds has this cause."""


def adapt_advice(
    findings: Iterable[Finding], samples: Samples, reference: Reference | None = None
) -> tuple[Finding, ...]:
    """The findings, what helps against them suited to where the samples were recorded. The
    `reference` is the one that they were calibrated by, if any."""
    found = tuple(findings)
    if any(finding.name == NORMALISED for finding in found):
        return tuple(finding for finding in found if finding.name in (NORMALISED, NOT_READ))
    if samples.frame in ("n", "e"):
        kept = (finding for finding in found if finding.name not in TURNING)
        axes = "north, east and down" if samples.frame == "n" else "Earth-fixed"
        told = Finding(
            "axes of the Earth",
            "refuse",
            f"the readings are components {axes}, not in the axes of a sensor: they hold no bias "
            "and no gain of it",
            "give the readings as the sensor made them",
        )
        return (told, *kept)
    if move := _choose_move(samples):
        found = tuple(
            replace(finding, move=move)
            if finding.name in TURNING and (finding.name == "static" or is_in_space(samples))
            else finding
            for finding in found
        )
    else:
        found = tuple(_name_other_ways(one, lacks_place(samples, reference)) for one in found)
    if samples.frame == "b":
        found = tuple(map(_correct_orientation, found))
    if reference is not None and samples.altitude_m is None and is_in_space(samples):
        missing = Finding(
            "altitude",
            "check",
            "the track is that of a spacecraft and has no altitude: the field was taken from the "
            "world model at sea level, where it is stronger by some 20 % than at 400 km",
            "log the altitude (altitude_m), or give it: agonic fit inflight LOG --altitude METRES",
        )
        found = (missing, *found)
    return sort_findings(found)


def adapt_fit(fit: Fit, samples: Samples, reference: Reference | None) -> Fit:
    """A fit with its advice adapted."""
    suited = adapt_advice(fit.findings, samples, reference)
    return fit if suited == fit.findings else replace(fit, findings=()).with_findings(*suited)


def lacks_place(samples: Samples, reference: Reference | None) -> bool:
    """Whether the log tells which way is down, and no field of the place is known to use it."""
    felt = samples.acceleration is not None
    logged = samples.roll_deg is not None and samples.pitch_deg is not None
    return reference is None and (felt or logged)


def is_in_space(samples: Samples) -> bool:
    """Whether the track is that of a spacecraft, by its altitude or its speed over the ground."""
    if samples.altitude_m is not None:
        return median(samples.altitude_m) > SPACE_ALTITUDE_M
    if samples.latitude_deg is None or samples.longitude_deg is None or samples.time is None:
        return False
    latitude, longitude = np.radians(samples.latitude_deg), np.radians(samples.longitude_deg)
    around = np.cos(latitude)
    up = np.stack([around * np.cos(longitude), around * np.sin(longitude), np.sin(latitude)])
    step = EARTH_RADIUS_M * np.linalg.norm(np.diff(up, axis=1), axis=0)
    speeds = step / np.diff(samples.time)
    return bool(len(speeds) and median(speeds) > SPACE_SPEED_M_S)


def _name_other_ways(finding: Finding, placeless: bool) -> Finding:
    """A refusal for want of turning, with what makes up for it: the place, or another method."""
    if finding.name not in TURNING or finding.name == "static" or finding.severity != "refuse":
        return finding
    place = (
        "give the place (--at LAT,LON): with it the accelerometer or the attitude in this log "
        "makes up for much of the turning; or "
    )
    move = f"{place * placeless}{finding.move}; what cannot be tilted: {LEVEL_PAGE}"
    return replace(finding, move=move)


def _correct_orientation(finding: Finding) -> Finding:
    """A mounting that cannot be told to agonic: the autopilot has turned the readings already."""
    if (finding.name, finding.severity) != ("mounting", "refuse"):
        return finding
    return replace(
        finding,
        move="correct the orientation that the autopilot was given for this sensor "
        "(COMPASS_ORIENT, CAL_MAGn_ROT) and log again",
    )


def _choose_move(samples: Samples) -> str:
    """What helps where the sensor cannot be turned at will; "" where it can."""
    if is_in_space(samples):
        return (
            "use a longer record, one in which the spacecraft turns, or a calibration from the "
            "ground (agonic fit inflight)"
        )
    if samples.duration_s is not None and samples.duration_s > STANDING_S:
        return (
            "a sensor that is mounted for good, as in an observatory, is calibrated against "
            "absolute measurements (agonic fit north); one that can be moved: turn it slowly about "
            "all three axes while recording"
        )
    return ""
