"""What a fit of the alignment is worth: what is undetermined, what does not fit, what else to know.

A wrong clock, longitude, latitude and variometer all turn the reference's axes. Where the platform
is turned about one axis only, such a turn is part of the alignment, and no residual shows it (the
external reliability of the net, in the words of geodesy).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from agonic.alignment.explanations import find_explanations, tell_misfit
from agonic.alignment.findings import tell
from agonic.alignment.maths.solution import RARE, UNDETERMINED, Solution
from agonic.alignment.maths.two_frames import (
    GROUPS,
    compute_turn_sd,
    find_unit_sizes,
    invert,
)
from agonic.alignment.session.earth import load_earth_rotation
from agonic.alignment.star_sensor.known_mistakes import (
    compute_misfit,
    find_likely_mistakes,
    find_way_from_nominal,
)
from agonic.alignment.star_sensor.plan import (
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
    "it is not determined by the field at one place; leave it out of solve, or state how well it "
    "is known (sd_nT of the pier, axes_sd_arcsec of the reference)"
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
    judged = replace(known, findings=tuple(_list_findings(known)))
    return judged if judged.verdict == "refused" else replace(judged, remarks=_remarks(known))


def _list_findings(fit: AlignmentFit) -> Iterator[Finding]:
    """What is undetermined, what does not fit, and what else to know of session and platform."""
    lost = fit.solution.undetermined[GROUPS["alignment"]]
    spoilt = bool(lost.size) and bool((lost**2).sum(axis=0).max() > TOUCHED)
    if fit.undetermined:
        yield _tell_undetermined(fit, spoilt)
    doubt = None if spoilt else _check_misfit(fit)
    if doubt is not None:
        yield doubt
    else:  # else these are what the same cause does
        if not spoilt and fit.worst_sd_arcsec > fit.wanted_sd_arcsec:
            yield tell(
                "alignment loose",
                sd=fit.worst_sd_arcsec,
                wanted=fit.wanted_sd_arcsec,
                action=_say_additions(fit.add),
            )
        low = int((fit.observed.elevation_deg < 0).sum())
        if low:
            yield tell("below the horizon", low=low, n=fit.n)
        yield from _check_scatter(fit)
        if not spoilt:
            yield from _check_reference(fit)
    yield from _check_surroundings(fit)


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


def _tell_undetermined(fit: AlignmentFit, spoilt: bool) -> Finding:
    """Combinations that nothing determines: some that matter to the alignment, others not."""
    shown = "; and ".join(fit.undetermined[:MOST_NAMED])
    more = len(fit.undetermined) - MOST_NAMED
    what = f"{shown}; and {more} more" if more > 0 else shown
    said = f"{fit.n} orientation{'s do' if fit.n > 1 else ' does'} not determine {what}"
    result = fit.solution
    each = compute_information(result.unknowns, result.measured, list_candidates())
    lost = result.undetermined / find_unit_sizes(result.magnitude)[:, None]
    told = np.einsum("ri,jrs,si->i", lost, each, lost)
    stuck = (told * (UNDETERMINED * result.magnitude) ** 2 < 1.0).any()  # by any orientation
    action = ELSEWHERE if stuck else _say_additions(fit.add)
    name = "alignment undetermined" if spoilt else "unknowns undetermined"
    return tell(name, what=said, action=action)


def _check_misfit(fit: AlignmentFit) -> Finding | None:
    """Residuals too large, or an alignment far from the nominal one, and what would explain it."""
    result = fit.solution
    if result.freedom == 0:
        return tell("no redundancy")
    bad = result.freedom > 0 and result.p_value < RARE
    away_deg = np.degrees(np.linalg.norm(find_way_from_nominal(fit.session, result)))
    sd_deg = np.inf if fit.session.mounting is None else fit.session.mounting.sd_deg
    if not (bad or away_deg > FAR_FROM_NOMINAL * sd_deg):
        return None
    seen = (
        f"the residuals are {figure(fit.residual_rms, 3)} nT rms, "
        f"{figure(float(np.sqrt(result.chi2 / result.freedom)))} times what the noise explains"
        if bad
        else f"the alignment is {figure(float(away_deg), 3)}° from the nominal mounting"
    )
    mistakes = find_likely_mistakes(fit.session, fit.solve, compute_misfit(fit.session, result))
    if mistakes:
        return tell_misfit("session mistake", seen, mistakes)
    if not bad:
        return tell("nominal mounting", what=seen)
    times = fit.observed.time, fit.observed.orientation
    found = find_explanations(result, *times, fit.session.site)
    return tell_misfit(
        "session misfit",
        seen if found else f"{seen}; none of the usual mistakes explains it",
        found,
        "look at the residuals of each orientation; solve for the magnetometer's bias and matrix, "
        "or for the pier",
    )


def _check_reference(fit: AlignmentFit) -> Iterator[Finding]:
    """Whether a small turn of the reference would move the alignment unseen.

    Not where the reference's axes are solved for or known to a stated standard deviation: then the
    standard error contains their turn.
    """
    if "reference" in fit.solution.groups:
        return
    prior = fit.solution.prior.copy()
    prior[GROUPS["reference"]] = 1 / (DOUBTED_ARCSEC * ARCSEC_RAD) ** 2
    doubted = compute_turn_sd(invert(fit.solution.information, prior)) / ARCSEC_RAD
    if doubted > WORSE * max(fit.worst_sd_arcsec, fit.wanted_sd_arcsec):
        prior[GROUPS["reference"]] = 0.0
        more = _say_additions(_suggest_orientations(fit, replace(fit.solution, prior=prior)))
        yield tell("reference unchecked", by=DOUBTED_ARCSEC, off=doubted, action=more)


def _check_scatter(fit: AlignmentFit) -> Iterator[Finding]:
    """Attitudes that scatter more within the orientations than their covariance says."""
    covariance, seen = fit.session.star.covariance, fit.observed.star_noise
    freedom = int((fit.observed.readings[:, 0] - 1).sum())
    if covariance is None or freedom < 10 or not np.isfinite(seen).all():
        return
    stated = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2).mean(axis=0))
    ratio = seen / np.array([np.hypot(stated[0], stated[1]) / np.sqrt(2), stated[2]])
    odd = chdtrc(freedom, freedom * ratio**2) < RARE
    if odd.any() and ratio.max() >= 1.3:
        which = int(ratio.argmax())
        yield tell("attitude scatter", ratio=float(ratio[which]), which=("across", "about")[which])


def _check_surroundings(fit: AlignmentFit) -> Iterator[Finding]:
    """Where north is, how the Earth stands, the angles' pole, and what the platform adds.

    A bias that is solved for contains the platform's field.
    """
    if fit.session.site.coordinates == "geodetic":
        yield tell("geodetic coordinates", otherwise=", or solve for the reference")
    earth, middle = load_earth_rotation(), fit.session.middle
    if middle > earth.measured_until:
        sd = earth.sd_arcsec(middle)
        newer = "install a newer astropy-iers-data and fit again" if sd > PREDICTED_ARCSEC else ""
        yield tell("predicted earth rotation", date=fit.session.date, sd=sd, action=newer)
    beta = fit.angles_deg[1]
    if min(beta, 180.0 - beta) < NEAR_POLE_DEG:
        yield tell("near-zero beta", known="sum" if beta < 90 else "difference")
    solved = {"platform remanence": "bias", "platform iron": "matrix"}
    for found in () if fit.platform is None else fit.platform.findings:
        known = solved.get(found.name) in fit.solve
        yield replace(found, severity="note", move="") if known else found


def _remarks(fit: AlignmentFit) -> tuple[str, ...]:
    """How good it is."""
    readings = int(fit.observed.readings[:, 1].sum())
    size = float(np.sqrt((fit.residuals_arcsec**2).mean()))
    return (
        f"standard error: {figure(fit.worst_sd_arcsec)}″ about the worst axis",
        f"residual of {fit.n} orientations ({readings} readings): {figure(fit.residual_rms)} nT a "
        f"component, or {figure(size)}″",
    )
