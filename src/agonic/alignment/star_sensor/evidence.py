"""What a fit of the alignment is worth: what is undetermined, what does not fit, what else to know.

A wrong clock, longitude, latitude and variometer all turn the reference's axes. Where the platform
is turned about one axis only, such a turn is part of the alignment, and no residual shows it (the
external reliability of the net, in the words of geodesy).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from agonic.alignment.explanations import find_explanations, say_explanations
from agonic.alignment.maths.solution import RARE, UNDETERMINED, Solution
from agonic.alignment.maths.two_frames import (
    GROUPS,
    compute_rotation_vector,
    compute_turn_sd,
    find_unit_sizes,
    invert,
)
from agonic.alignment.session import load_earth_rotation
from agonic.alignment.star_sensor.likely_causes import compute_misfit, find_likely_mistakes
from agonic.alignment.star_sensor.orientations import (
    choose_additions,
    compute_information,
    describe_combination,
    list_candidates,
)
from agonic.alignment.star_sensor.result import AlignmentFit
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
FAR_FROM_NOMINAL = 4.0
"""Standard deviations of the mounting."""
DOUBTED_ARCSEC = 10.0
"""A turn of the reference that happens: a clock wrong by 0.7 s, a variometer by 0.003°."""
WORSE = 1.5
"""Times the stated or wanted standard error above which such a turn matters."""


def examine(fit: AlignmentFit) -> AlignmentFit:
    """The fit with its findings and its remarks."""
    result = fit.solution
    words = tuple(
        describe_combination(column, result.unknowns, result.measured)
        for column in result.undetermined.T
    )
    loose = fit.worst_sd_arcsec > fit.wanted_sd_arcsec
    known = replace(fit, undetermined=words)
    if words or loose:
        known = replace(known, add=_suggest_orientations(known, result))
    spoilt = _spoilt(known)
    doubt = None if spoilt else _check_misfit(known)
    checks = [_check_undetermined(known), doubt]
    if doubt is None:  # else these are what the same cause does
        checks += [] if spoilt else [_check_loose(known)]
        checks += [_check_horizon(known), _check_scatter(known)]
        checks += [] if spoilt else [_check_reference(known)]
    checks += [_check_coordinates(known), _check_earth(known), _check_pole(known)]
    findings = (*(found for found in checks if found is not None), *_list_platform(known))
    judged = replace(known, findings=findings)
    return judged if judged.verdict == "refused" else replace(judged, remarks=_remarks(known))


def _suggest_orientations(
    fit: AlignmentFit, result: Solution
) -> tuple[tuple[float, float, float], ...]:
    """Up to four orientations that shrink the worst combination most, one after the other."""
    chosen = list_candidates()
    each = compute_information(result.unknowns, result.measured, chosen)
    wanted = fit.wanted_sd_arcsec * ARCSEC_RAD * result.magnitude

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


def _say_additions(add: tuple[tuple[float, float, float], ...]) -> str:
    """Which orientations to add, in words; those that orientations cannot help have another way."""
    if not add:
        return "take more readings"
    return "add orientations: " + "; ".join(map(format_orientation, add))


def _check_undetermined(fit: AlignmentFit) -> Finding | None:
    """Combinations that nothing determines: some that matter to the alignment, others not."""
    if not fit.undetermined:
        return None
    shown = "; and ".join(fit.undetermined[:MOST_NAMED])
    more = len(fit.undetermined) - MOST_NAMED
    what = f"{shown}; and {more} more" if more > 0 else shown
    said = f"{fit.n} orientation{'s do' if fit.n > 1 else ' does'} not determine {what}"
    move = ELSEWHERE if _stuck(fit.solution) else _say_additions(fit.add)
    if _spoilt(fit):
        return Finding("alignment undetermined", "refuse", said, move)
    return Finding("unknowns undetermined", "check", f"{said}, which the alignment survives", move)


def _spoilt(fit: AlignmentFit) -> bool:
    """Whether an undetermined combination has a part in the alignment."""
    lost = fit.solution.undetermined
    return bool(lost.size) and bool((lost[GROUPS["alignment"]] ** 2).sum(axis=0).max() > TOUCHED)


def _stuck(result: Solution) -> bool:
    """Whether no orientation could tell what is undetermined."""
    each = compute_information(result.unknowns, result.measured, list_candidates())
    lost = result.undetermined / find_unit_sizes(result.magnitude)[:, None]
    told = np.einsum("ri,jrs,si->i", lost, each, lost)
    return bool((told * (UNDETERMINED * result.magnitude) ** 2 < 1.0).any())


def _check_misfit(fit: AlignmentFit) -> Finding | None:
    """Residuals too large, or an alignment far from the nominal one, and what would explain it."""
    result = fit.solution
    if result.freedom == 0:
        what = "the orientations just determine the unknowns, so nothing tells a mistake"
        return Finding("no redundancy", "check", what, "add orientations")
    bad = result.freedom > 0 and result.p_value < RARE
    away_deg, sd_deg = _find_way_from_nominal(fit)
    if not (bad or away_deg > FAR_FROM_NOMINAL * sd_deg):
        return None
    seen = (
        f"the residuals are {figure(fit.residual_rms, 3)} nT rms, "
        f"{figure(float(np.sqrt(result.chi2 / result.freedom)))} times what the noise explains"
        if bad
        else f"the alignment is {figure(away_deg, 3)}° from the nominal mounting"
    )
    causes = find_likely_mistakes(fit.session, fit.solve, compute_misfit(fit.session, result))
    if causes:
        others = "; ".join(cause.words for cause in causes[1:4])
        also = f" (as well: {others})" if others else ""
        said = f"{seen}; {causes[0].words} would explain it{also}"
        return Finding("session mistake", "refuse", said, causes[0].move)
    if bad:
        return _describe_misfit(fit, seen)
    return Finding("nominal mounting", "check", seen, "check the nominal angles and the axes")


def _describe_misfit(fit: AlignmentFit, seen: str) -> Finding:
    """Residuals that no usual mistake explains, with what else would."""
    seen_at = fit.observed.time, fit.observed.orientation
    found = find_explanations(fit.solution, *seen_at, fit.session.site)
    if found:
        return Finding("session misfit", "check", say_explanations(seen, found), found[0].move)
    said = f"{seen}; none of the usual mistakes explains it"
    move = (
        "look at the residuals of each orientation; solve for the magnetometer's bias and "
        "matrix, or for the pier"
    )
    return Finding("session misfit", "check", said, move)


def _find_way_from_nominal(fit: AlignmentFit) -> tuple[float, float]:
    """How far the alignment is from the nominal one, degrees, and the nominal one's sd."""
    mounting = fit.session.mounting
    if mounting is None:
        return 0.0, np.inf
    turn = compute_rotation_vector(fit.rot_mc @ mounting.rot_mc.T)
    return float(np.degrees(np.linalg.norm(turn))), mounting.sd_deg


def _check_loose(fit: AlignmentFit) -> Finding | None:
    """An alignment that is known less well than wanted."""
    if fit.worst_sd_arcsec <= fit.wanted_sd_arcsec:
        return None
    what = (
        f"the alignment is known to {figure(fit.worst_sd_arcsec)}″ about its worst axis, not to "
        f"{fit.wanted_sd_arcsec:g}″"
    )
    return Finding("alignment loose", "check", what, _say_additions(fit.add))


def _check_reference(fit: AlignmentFit) -> Finding | None:
    """Whether a small turn of the reference would move the alignment unseen.

    Not where the reference's axes are solved for or known to a stated standard deviation: then the
    standard error contains their turn.
    """
    if "reference" in fit.solution.groups:
        return None
    prior = fit.solution.prior.copy()
    prior[GROUPS["reference"]] = 1 / (DOUBTED_ARCSEC * ARCSEC_RAD) ** 2
    doubted = compute_turn_sd(invert(fit.solution.information, prior)) / ARCSEC_RAD
    if doubted <= WORSE * max(fit.worst_sd_arcsec, fit.wanted_sd_arcsec):
        return None
    what = (
        "these orientations do not tell whether the reference's axes and the clocks are right: "
        f"were they off by {DOUBTED_ARCSEC:g}″ (0.7 s of a clock), the alignment would be off by "
        f"up to {figure(doubted)}″, and no residual would show it"
    )
    prior[GROUPS["reference"]] = 0.0
    more = _say_additions(_suggest_orientations(fit, replace(fit.solution, prior=prior)))
    move = (
        f"{more}; or state how well north and the clocks are known (axes_sd_arcsec of the "
        "reference; a second is 15″)"
    )
    return Finding("reference unchecked", "check", what, move)


def _check_horizon(fit: AlignmentFit) -> Finding | None:
    """A star sensor that cannot see what it says it sees."""
    low = int((fit.observed.elevation_deg < 0).sum())
    if not low:
        return None
    what = f"the star sensor looks below the horizon in {low} of {fit.n} orientations"
    move = "check longitude, time scale and the sense of the attitudes"
    return Finding("below the horizon", "check", what, move)


def _check_scatter(fit: AlignmentFit) -> Finding | None:
    """Attitudes that scatter more within the orientations than their covariance says."""
    covariance, seen = fit.session.star.covariance, fit.observed.star_noise
    freedom = int((fit.observed.readings[:, 0] - 1).sum())
    if covariance is None or freedom < 10 or not np.isfinite(seen).all():
        return None
    stated = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2).mean(axis=0))
    ratio = seen / np.array([np.hypot(stated[0], stated[1]) / np.sqrt(2), stated[2]])
    odd = chdtrc(freedom, freedom * ratio**2) < RARE
    if not odd.any() or ratio.max() < 1.3:
        return None
    which = int(ratio.argmax())
    what = (
        f"within the orientations the attitudes scatter {figure(float(ratio[which]))} times as "
        f"much {('across', 'about')[which]} the boresight as stated"
    )
    move = "let the platform settle, check the numbers of the orientations, or state a larger sd"
    return Finding("attitude scatter", "check", what, move)


def _check_coordinates(fit: AlignmentFit) -> Finding | None:
    if fit.session.site.coordinates != "geodetic":
        return None
    what = (
        "the site's coordinates are geodetic: north and down may be off by up to 20″, the "
        "deflection of the vertical"
    )
    move = "give astronomical coordinates, or solve for the reference"
    return Finding("geodetic coordinates", "check", what, move)


def _check_earth(fit: AlignmentFit) -> Finding | None:
    """A rotation of the Earth that is predicted."""
    earth, middle = load_earth_rotation(), fit.session.middle
    if middle <= earth.measured_until:
        return None
    sd = earth.sd_arcsec(middle)
    what = (
        f"the Earth's rotation on {fit.session.date} is predicted, not measured, by the "
        f"installed table, which may be off by {figure(sd)}″"
    )
    move = "install a newer astropy-iers-data and fit again" if sd > PREDICTED_ARCSEC else ""
    return Finding("predicted earth rotation", "note", what, move)


def _check_pole(fit: AlignmentFit) -> Finding | None:
    beta = fit.angles_deg[1]
    if min(beta, 180.0 - beta) >= NEAR_POLE_DEG:
        return None
    what = (
        "the third axes of star sensor and magnetometer are all but parallel, so only the "
        f"{'sum' if beta < 90 else 'difference'} of α and γ is determined; quaternion and matrix "
        "are good"
    )
    return Finding("near-zero beta", "note", what)


def _list_platform(fit: AlignmentFit) -> list[Finding]:
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
