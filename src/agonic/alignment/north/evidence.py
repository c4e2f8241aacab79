"""What is wrong or worth knowing of true north, and how good it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.alignment.explanations import find_explanations, say_explanations
from agonic.alignment.maths.solution import RARE
from agonic.alignment.north.platform import Aligned
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
    found = (
        *_list_disagreements(fit),
        _check_swing(fit),
        _check_drift(fit),
        _check_scatter(fit),
        _check_spread(fit),
        *_list_bad_faces(fit),
        _check_platform(fit.aligned),
        _check_settling(fit.aligned),
    )
    judged = replace(fit, findings=tuple(one for one in found if one is not None))
    return judged if judged.verdict == "refused" else replace(judged, remarks=_remarks(fit))


def _list_disagreements(fit: NorthFit) -> list[Finding]:
    best, said = fit.by[fit.method], []
    move = (
        "check that all were read on one circle, east increasing, and that amplitudes and times "
        "belong together"
    )
    for name, other in fit.by.items():
        apart = abs(float(wrap_deg(other.reading_deg - best.reading_deg)))
        if name != fit.method and apart > APART * float(np.hypot(other.sd_deg, best.sd_deg)):
            what = f"{fit.method} and {name} differ by {figure(3600 * apart)}″"
            said.append(Finding("methods disagree", "check", what, move))
    return said


def _check_swing(fit: NorthFit) -> Finding | None:
    if fit.swing is None or fit.session.swing is None or fit.period_s is None:
        return None
    periods = float(np.ptp(fit.session.swing.time_s)) / fit.period_s
    if fit.swing.converged and periods >= FEW_PERIODS:
        return None
    what = f"the record holds {figure(periods)} periods of the swing"
    return Finding("short swing", "check", what, "follow the gyro for two periods or more")


def _check_drift(fit: NorthFit) -> Finding | None:
    if not fit.drift.seen:
        return None
    what = (
        f"the middle of the swing moves by {figure(3600 * abs(fit.drift.size_deg))}″ over the "
        "record, so north is known to half of that at best"
    )
    move = "let the gyro warm up, keep it out of sun and wind, and follow it again"
    return Finding("zero drifts", "check", what, move)


def _check_scatter(fit: NorthFit) -> Finding | None:
    """Readings of the circle that scatter by more than what was stated of one."""
    read = {fit.method: fit.by[fit.method].excess} | {one.name: one.excess for one in fit.azimuths}
    name, excess = max(read.items(), key=lambda item: item[1])
    if excess <= 1.0:
        return None
    what = (
        f"the readings of {name} scatter by {figure(excess)} times the stated noise; the standard "
        "error was widened"
    )
    move = "look for a misread circle or a zero that drifts, and read again"
    return Finding("readings scatter", "check", what, move)


def _check_spread(fit: NorthFit) -> Finding | None:
    if np.isfinite(fit.by[fit.method].sd_deg):
        return None
    move = "read more turning points, or state reading_sd_arcsec or time_sd_s"
    return Finding("no spread", "check", "nothing tells how well north is known", move)


def _list_bad_faces(fit: NorthFit) -> list[Finding]:
    apart = {one.name: 2 * abs(one.collimation_arcsec) for one in fit.azimuths}
    return [
        Finding(
            "faces",
            "check",
            f"the two faces to {name} differ by {figure(differ)}″ and half a turn",
            "check the readings, and adjust the theodolite",
        )
        for name, differ in apart.items()
        if differ > 2 * BAD_FACES_ARCSEC
    ]


def _check_platform(found: Aligned | None) -> Finding | None:
    """A platform turned too seldom, or whose residuals are more than noise."""
    if found is None:
        return None
    if len(found.orientation) < 2:
        what = "one orientation leaves the turn about the field open"
        return Finding("orientations", "refuse", what, "turn the platform to at least two others")
    solution = found.solution
    if solution.p_value >= RARE:
        return None
    more = figure(float(np.sqrt(solution.chi2 / solution.freedom)))
    move = (
        "check mirror, orientation numbers, axes of the reference, and the magnetometer's "
        "calibration"
    )
    what = f"the residuals are {more} times what the noise explains"
    causes = find_explanations(solution, found.time, found.orientation)
    if causes:
        what, move = say_explanations(what, causes), causes[0].move
    return Finding("platform misfit", "check", what, move)


def _check_settling(found: Aligned | None) -> Finding | None:
    """A platform that went on turning after it was set."""
    if found is None or not found.settled_by.any():
        return None
    turned = figure(float(np.linalg.norm(found.settled_by)) / ARCSEC_RAD)
    what = (
        f"the magnetometer turned by {turned}″ while an orientation was recorded; circle and "
        "levels tell one moment of it, and the standard error was widened by as much"
    )
    move = "wait after each turn until the readings rest, and clamp the platform"
    return Finding("platform settles", "check", what, move)


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
