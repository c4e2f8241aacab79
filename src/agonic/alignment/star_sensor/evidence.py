"""What a fit of the alignment is worth: what is undetermined, and under which circumstances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from agonic.alignment.maths.solution import UNDETERMINED, Solution
from agonic.alignment.maths.two_frames import GROUPS
from agonic.alignment.maths.two_frames import find_unit_sizes as units_of
from agonic.alignment.session import load_earth_rotation
from agonic.alignment.star_sensor.doubts import RARE, doubt
from agonic.alignment.star_sensor.orientations import (
    choose_additions,
    compute_information,
    describe_combination,
    list_candidates,
)
from agonic.alignment.star_sensor.result import AlignmentFit
from agonic.alignment.star_sensor.unchecked_reference import examine_reference
from agonic.health import Finding, figure
from agonic.maths.rotations.frames import ARCSEC_RAD

MOST_ADDED, MOST_NAMED = 4, 2
TOUCHED = 1e-3
"""Share of the alignment in a combination from which it is spoilt where that is undetermined."""
ELSEWHERE = (
    "the field at one place cannot tell; leave it out of solve, or state how well it is known "
    "(sd_nT of the pier, axes_sd_arcsec of the reference)"
)
NEAR_POLE_DEG = 1.0
PREDICTED_ARCSEC = 0.5


def examine(fit: AlignmentFit, wanted_sd_arcsec: float) -> AlignmentFit:
    """The fit with its findings and its remarks."""
    result = fit.solution
    lost = result.undetermined
    words = (
        tuple(
            describe_combination(column, result.unknowns, result.measured)
            for column in np.atleast_2d(lost.T)
        )
        if lost.size
        else ()
    )
    loose = fit.worst_sd_arcsec > wanted_sd_arcsec
    add = suggest_orientations(result, wanted_sd_arcsec) if words or loose else ()
    known = replace(fit, undetermined=words, add=add)
    spoilt = _spoilt(known)
    doubts = [] if spoilt else doubt(known)
    findings = _check_undetermined(known) + doubts
    if not doubts:  # else these are what the same cause does
        findings += [] if spoilt else _loose(known, wanted_sd_arcsec)
        findings += _below_horizon(known) + _scatter(known)
        findings += [] if spoilt else _reference(known, wanted_sd_arcsec)
    findings += _circumstances(known) + _platform(known)
    refused = any(finding.severity == "refuse" for finding in findings)
    return replace(known, findings=tuple(findings), remarks=() if refused else _remarks(known))


def suggest_orientations(
    result: Solution, wanted_sd_arcsec: float
) -> tuple[tuple[float, float, float], ...]:
    """Up to four orientations that shrink the worst combination most, one after the other."""
    chosen = list_candidates()
    each = compute_information(result.unknowns, result.measured, chosen)
    wanted = wanted_sd_arcsec * ARCSEC_RAD * result.magnitude

    def enough(added: list[int], worst: float) -> bool:
        return len(added) == MOST_ADDED or worst < wanted

    best = choose_additions(
        result.information, each, chosen, result.prior, result.magnitude, enough
    )
    return tuple(chosen[k] for k in best)


def format_orientation(orientation: tuple[float, float, float]) -> str:
    """Where to look, in words.

    >>> format_orientation((90.0, 65.0, 45.0)), format_orientation((0.0, 90.0, 0.0))
    ('azimuth 90°, elevation 65°, roll 45°', 'the zenith, roll 0°')
    """
    azimuth, elevation, roll = orientation
    where = "the zenith" if elevation == 90 else f"azimuth {azimuth:g}°, elevation {elevation:g}°"
    return f"{where}, roll {roll:g}°"


def _moves(fit: AlignmentFit) -> str:
    """Which orientations to add, in words; those that orientations cannot help have another way."""
    if not fit.add:
        return "take more readings"
    return "add orientations: " + "; ".join(map(format_orientation, fit.add))


def _check_undetermined(fit: AlignmentFit) -> list[Finding]:
    """Combinations that nothing determines: some that matter to the alignment, others not."""
    if not fit.undetermined:
        return []
    shown = "; and ".join(fit.undetermined[:MOST_NAMED])
    more = len(fit.undetermined) - MOST_NAMED
    what = f"{shown}; and {more} more" if more > 0 else shown
    said = f"{fit.n} orientation{'s do' if fit.n > 1 else ' does'} not determine {what}"
    move = ELSEWHERE if _stuck(fit) else _moves(fit)
    if _spoilt(fit):
        return [Finding("alignment undetermined", "refuse", said, move)]
    return [
        Finding("unknowns undetermined", "check", f"{said}, which the alignment survives", move)
    ]


def _spoilt(fit: AlignmentFit) -> bool:
    """Whether an undetermined combination has a part in the alignment."""
    lost = fit.solution.undetermined
    return bool(lost.size) and bool((lost[GROUPS["alignment"]] ** 2).sum(axis=0).max() > TOUCHED)


def _stuck(fit: AlignmentFit) -> bool:
    """Whether no orientation could tell what is undetermined."""
    result = fit.solution
    each = compute_information(result.unknowns, result.measured, list_candidates())
    units = units_of(result.magnitude)
    lost = result.undetermined / units[:, None]
    told = np.einsum("ri,jrs,si->i", lost, each, lost)
    return bool((told * (UNDETERMINED * result.magnitude) ** 2 < 1.0).any())


def _loose(fit: AlignmentFit, wanted_sd_arcsec: float) -> list[Finding]:
    """An alignment that is known less well than wanted."""
    if fit.worst_sd_arcsec <= wanted_sd_arcsec:
        return []
    return [
        Finding(
            "alignment loose",
            "check",
            f"the alignment is known to {figure(fit.worst_sd_arcsec)}″ about its worst axis, not "
            f"to {wanted_sd_arcsec:g}″",
            _moves(fit),
        )
    ]


def _reference(fit: AlignmentFit, wanted_sd_arcsec: float) -> list[Finding]:
    """A reference that nothing checks, and the orientations that would."""

    def moves() -> str:
        prior = fit.solution.prior.copy()
        prior[GROUPS["reference"]] = 0.0
        more = suggest_orientations(replace(fit.solution, prior=prior), wanted_sd_arcsec)
        return _moves(replace(fit, add=more))

    return examine_reference(fit, wanted_sd_arcsec, moves)


def _below_horizon(fit: AlignmentFit) -> list[Finding]:
    """A star sensor that cannot see what it says it sees."""
    low = fit.observed.orientation[fit.observed.elevation_deg < 0]
    if not len(low):
        return []
    return [
        Finding(
            "below the horizon",
            "check",
            f"the star sensor looks below the horizon in {len(low)} of {fit.n} orientations",
            "check longitude, time scale and the sense of the attitudes",
        )
    ]


def _circumstances(fit: AlignmentFit) -> list[Finding]:
    """What is worth knowing beside the residuals."""
    session = fit.session
    findings = []
    if session.site.coordinates == "geodetic":
        findings.append(
            Finding(
                "geodetic coordinates",
                "check",
                "the site's coordinates are geodetic: north and down may be off by up to 20″, the "
                "deflection of the vertical",
                "give astronomical coordinates, or solve for the reference",
            )
        )
    earth = load_earth_rotation()
    sd = earth.sd_arcsec(session.middle)
    if session.middle > earth.measured_until:
        findings.append(
            Finding(
                "predicted earth rotation",
                "note",
                f"the Earth's rotation on {session.date} is predicted, not measured, by the "
                f"installed table, which may be off by {figure(sd)}″",
                "install a newer astropy-iers-data and fit again" if sd > PREDICTED_ARCSEC else "",
            )
        )
    pole = min(fit.angles_deg[1], 180.0 - fit.angles_deg[1])
    if pole < NEAR_POLE_DEG:
        findings.append(
            Finding(
                "near-zero beta",
                "note",
                "the third axes of star sensor and magnetometer are all but parallel, so only the "
                f"{'sum' if fit.angles_deg[1] < 90 else 'difference'} of α and γ is determined; "
                "quaternion and matrix are good",
            )
        )
    return findings


def _scatter(fit: AlignmentFit) -> list[Finding]:
    """Attitudes that scatter more within the orientations than their covariance says."""
    covariance = fit.session.star.covariance
    freedom = int((fit.observed.readings[:, 0] - 1).sum())
    if covariance is None or freedom < 10 or not np.isfinite(fit.observed.star_noise).all():
        return []
    stated = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2).mean(axis=0))
    stated = np.array([np.hypot(stated[0], stated[1]) / np.sqrt(2), stated[2]])
    ratio = fit.observed.star_noise / stated
    odd = chdtrc(freedom, freedom * ratio**2) < RARE
    if not odd.any() or ratio.max() < 1.3:
        return []
    which = int(ratio.argmax())
    return [
        Finding(
            "attitude scatter",
            "check",
            f"within the orientations the attitudes scatter {figure(float(ratio[which]))} times as "
            f"much {('across', 'about')[which]} the boresight as stated",
            "let the platform settle, check the numbers of the orientations, or state a larger sd",
        )
    ]


def _platform(fit: AlignmentFit) -> list[Finding]:
    """What the platform adds by itself; a bias that is solved for contains it."""
    if fit.platform is None:
        return []
    solved = {"platform remanence": "bias", "platform iron": "matrix"}
    return [
        replace(found, severity="note", move="") if solved.get(found.name) in fit.solve else found
        for found in fit.platform.findings
    ]


def _remarks(fit: AlignmentFit) -> tuple[str, ...]:
    """How good it is."""
    readings = int(fit.observed.readings[:, 1].sum())
    size = float(np.sqrt((fit.residuals_arcsec**2).mean()))
    return (
        f"standard error: {figure(fit.worst_sd_arcsec)}″ about the worst axis",
        f"residual of {fit.n} orientations ({readings} readings): {figure(fit.residual_rms)} nT a "
        f"component, or {figure(size)}″",
    )
