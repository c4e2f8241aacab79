"""What is wrong or worth knowing of true north, and how good it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.alignment.north.platform import RARE, Aligned
from agonic.alignment.north.result import NorthFit
from agonic.health import Finding, figure
from agonic.maths.rotations.angles import wrap_deg
from agonic.maths.rotations.frames import ARCSEC_RAD

APART = 4.0
"""Two methods that differ by more standard errors do not agree."""
FEW_PERIODS = 1.0
BAD_FACES_ARCSEC = 60.0


def examine(fit: NorthFit) -> NorthFit:
    """The fit with its findings and, where it is not refused, how good it is."""
    said = (
        *_disagreement(fit),
        *_swing(fit),
        *_drift(fit),
        *_scatter(fit),
        *_no_spread(fit),
        *_faces(fit),
        *_platform(fit.aligned),
        *_settling(fit.aligned),
    )
    judged = replace(fit, findings=said)
    return judged if judged.verdict == "refused" else replace(judged, remarks=_remarks(fit))


def _no_spread(fit: NorthFit) -> list[Finding]:
    if np.isfinite(fit.by[fit.method].sd_deg):
        return []
    return [
        Finding(
            "no spread",
            "check",
            "nothing tells how well north is known",
            "read more turning points, or state reading_sd_arcsec or time_sd_s",
        )
    ]


def _faces(fit: NorthFit) -> list[Finding]:
    return [
        Finding(
            "faces",
            "check",
            f"the two faces to {azimuth.name} differ by "
            f"{figure(2 * abs(azimuth.collimation_arcsec))}″ and half a turn",
            "check the readings, and adjust the theodolite",
        )
        for azimuth in fit.azimuths
        if abs(azimuth.collimation_arcsec) > BAD_FACES_ARCSEC
    ]


def _platform(found: Aligned | None) -> list[Finding]:
    """A platform turned too seldom, or whose residuals are more than noise."""
    if found is None:
        return []
    if len(found.orientation) < 2:
        return [
            Finding(
                "orientations",
                "refuse",
                "one orientation leaves the turn about the field open",
                "turn the platform to at least two others",
            )
        ]
    solution = found.solution
    if solution.p_value >= RARE:
        return []
    return [
        Finding(
            "platform misfit",
            "check",
            f"the residuals are {figure(float(np.sqrt(solution.chi2 / solution.freedom)))} times "
            "what the noise explains",
            "check mirror, orientation numbers, axes of the reference, and "
            "the magnetometer's calibration",
        )
    ]


def _settling(found: Aligned | None) -> list[Finding]:
    """A platform that went on turning after it was set."""
    if found is None or not found.settled_by.any():
        return []
    turned = figure(float(np.linalg.norm(found.settled_by)) / ARCSEC_RAD)
    return [
        Finding(
            "platform settles",
            "check",
            f"the magnetometer turned by {turned}″ while an orientation was recorded; circle and "
            "levels tell one moment of it, and the standard error was widened by as much",
            "wait after each turn until the readings rest, and clamp the platform",
        )
    ]


def _scatter(fit: NorthFit) -> list[Finding]:
    """Readings of the circle that scatter by more than what was stated of one."""
    read = {fit.method: fit.by[fit.method].excess} | {one.name: one.excess for one in fit.azimuths}
    name, excess = max(read.items(), key=lambda item: item[1])
    if excess <= 1.0:
        return []
    return [
        Finding(
            "readings scatter",
            "check",
            f"the readings of {name} scatter by {figure(excess)} times the stated noise; the "
            "standard error was widened",
            "look for a misread circle or a zero that drifts, and read again",
        )
    ]


def _disagreement(fit: NorthFit) -> list[Finding]:
    best = fit.by[fit.method]
    said = []
    for name, other in fit.by.items():
        apart = abs(float(wrap_deg(other.reading_deg - best.reading_deg)))
        if name != fit.method and apart > APART * float(np.hypot(other.sd_deg, best.sd_deg)):
            said.append(
                Finding(
                    "methods disagree",
                    "check",
                    f"{fit.method} and {name} differ by {figure(3600 * apart)}″",
                    "check that all were read on one circle, east "
                    "increasing, and that amplitudes and times belong together",
                )
            )
    return said


def _swing(fit: NorthFit) -> list[Finding]:
    if fit.swing is None or fit.session.swing is None or fit.period_s is None:
        return []
    periods = float(np.ptp(fit.session.swing.time_s)) / fit.period_s
    if fit.swing.converged and periods >= FEW_PERIODS:
        return []
    return [
        Finding(
            "short swing",
            "check",
            f"the record holds {figure(periods)} periods of the swing",
            "follow the gyro for two periods or more",
        )
    ]


def _drift(fit: NorthFit) -> list[Finding]:
    if not fit.drift.seen:
        return []
    return [
        Finding(
            "zero drifts",
            "check",
            f"the middle of the swing moves by {figure(3600 * abs(fit.drift.size_deg))}″ over the "
            "record, so north is known to half of that at best",
            "let the gyro warm up, keep it out of sun and wind, and follow it again",
        )
    ]


def _remarks(fit: NorthFit) -> tuple[str, ...]:
    """How good it is."""
    said = [
        f"true north is at {fit.north_deg:.5f}° ± {figure(fit.sd_arcsec)}″ of the circle, by "
        f"{fit.method}"
    ]
    if not np.isfinite(fit.drift.sd_deg):
        said.append(
            "so few readings do not tell whether the zero drifts: follow the gyro for eight "
            "turning points, or record its swing"
        )
    if fit.aligned is not None:
        said.append(
            f"standard error of the alignment: {figure(fit.aligned.worst_sd_arcsec)}″ about its "
            "worst axis"
        )
    return tuple(said)
