"""What an alignment rests on: what is undetermined, what does not fit, and what is doubtful.

A wrong clock, longitude, latitude and variometer all turn the reference's axes. Where the platform
is turned about one axis only, such a turn is part of the alignment, and no residual shows it (the
external reliability of the net, in the words of geodesy).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice, takewhile
from typing import Any

import numpy as np
from scipy.special import chdtrc

from agonic.alignment.explanations import describe_misfit, find_explanations
from agonic.alignment.maths.two_frames import (
    GROUPS,
    RARE,
    UNDETERMINED,
    Solution,
    compute_turn_sd,
    find_unit_sizes,
    invert,
)
from agonic.alignment.session.earth import load_earth_rotation
from agonic.alignment.session.session import DEFLECTION
from agonic.alignment.star_sensor.known_mistakes import (
    compute_misfit,
    find_likely_mistakes,
    find_way_from_nominal,
)
from agonic.alignment.star_sensor.plan import (
    choose_additions,
    describe_combination,
    list_candidates,
    predict_information,
)
from agonic.alignment.star_sensor.result import AlignmentFit
from agonic.health import Finding, figure
from agonic.health.finding import Fact, Limit, Told, find_facts
from agonic.maths.rotations.frames import ARCSEC_RAD

DOUBTED_ARCSEC = 10.0
"""A turn of the reference that happens: a clock wrong by 0.7 s, a variometer by 0.003°."""


def examine(fit: AlignmentFit) -> AlignmentFit:
    """The fit with its findings and its remarks."""
    result = fit.solution
    words = tuple(
        describe_combination(column, result.unknowns, result.measured)
        for column in result.undetermined.T
    )
    known = replace(fit, undetermined=words)
    if words or fit.worst_sd_arcsec > fit.wanted_sd_arcsec:
        known = replace(known, add=_suggest_orientations(known, result))
    judged = replace(known, findings=tuple(_list_findings(known)))
    if judged.verdict == "refused":
        return judged
    size = float(np.sqrt((fit.residuals_arcsec**2).mean()))
    remarks = (
        f"standard error: {figure(fit.worst_sd_arcsec)}″ about the worst axis",
        f"residual of {fit.n} orientations ({int(fit.observed.readings[:, 1].sum())} readings): "
        f"{figure(fit.residual_rms)} nT a component, or {figure(size)}″",
    )
    return replace(judged, remarks=remarks)


def _list_findings(fit: AlignmentFit) -> Iterator[Finding]:
    """What is undetermined and what does not fit; else what is loose or doubtful, which the same
    cause may do; and the surroundings."""
    yield from find_facts(OF_UNKNOWNS, fit)
    spoilt = is_spoilt(fit)
    misfit = {} if spoilt else _find_misfit(fit)
    yield from find_facts(OF_MISFIT, misfit)
    if not misfit:
        yield from find_facts(OF_FIT, fit)
    yield from find_facts(OF_SURROUNDINGS, fit)
    solved = {"platform remanence": "bias", "platform iron": "matrix"}
    for found in () if fit.platform is None else fit.platform.findings:
        # a bias that is solved for contains the platform's field
        known = solved.get(found.name) in fit.solve
        yield replace(found, severity="note", move="") if known else found


def is_spoilt(fit: AlignmentFit) -> bool:
    """Whether the alignment has a share in what is undetermined; it is so too then."""
    lost = fit.solution.undetermined[GROUPS["alignment"]]
    return bool((lost**2).sum(axis=0).max(initial=0.0) > 1e-3)


def _suggest_orientations(
    fit: AlignmentFit, result: Solution
) -> tuple[tuple[float, float, float], ...]:
    """Up to four orientations that shrink the worst combination most, one after the other."""
    chosen, at = list_candidates(), result.unknowns
    wanted = fit.wanted_sd_arcsec * ARCSEC_RAD * result.magnitude
    each = predict_information(at, result.measured, chosen)
    best = choose_additions(result.information, each, chosen, result.prior, result.magnitude)
    needed = takewhile(lambda one: one[0] >= wanted, best)
    return tuple(chosen[k] for _, k in islice(needed, 4))


def write_additions(add: Sequence[tuple[float, float, float]]) -> str:
    """Which orientations to add, in words; those that orientations cannot help have another way."""
    said = []
    for azimuth, elevation, roll in add:
        where = f"azimuth {azimuth:g}°, elevation {elevation:g}°"
        said.append(f"{'the zenith' if elevation == 90 else where}, roll {roll:g}°")
    return f"add orientations: {'; '.join(said)}" if said else "take more readings"


def _describe_undetermined(fit: AlignmentFit) -> Mapping[str, Any]:
    """The combinations that nothing determines, and what would."""
    shown, more = "; and ".join(fit.undetermined[:2]), len(fit.undetermined) - 2
    what = f"{shown}; and {more} more" if more > 0 else shown
    said = f"{fit.n} orientation{'s do' if fit.n > 1 else ' does'} not determine {what}"
    result = fit.solution
    each = predict_information(result.unknowns, result.measured, list_candidates())
    lost = result.undetermined / find_unit_sizes(result.magnitude)[:, None]
    explained = np.einsum("ri,jrs,si->i", lost, each, lost)
    stuck = (explained * (UNDETERMINED * result.magnitude) ** 2 < 1.0).any()  # by any orientation
    elsewhere = (
        "it is not determined by the field at one place; leave it out of solve, or state how well "
        "it is known (sd_nT of the pier, axes_sd_arcsec of the reference)"
    )
    return {"what": said, "action": elsewhere if stuck else write_additions(fit.add)}


def _find_spoilt(fit: AlignmentFit) -> Told:
    return _describe_undetermined(fit) if fit.undetermined and is_spoilt(fit) else None


def _find_undetermined(fit: AlignmentFit) -> Told:
    return None if not fit.undetermined or is_spoilt(fit) else _describe_undetermined(fit)


def _name(name: str) -> Callable[[Mapping[str, Told]], Told]:
    return lambda misfit: misfit.get(name)


def _find_misfit(fit: AlignmentFit) -> dict[str, Mapping[str, Any]]:
    """Residuals too large, or an alignment far from the nominal one, and what would explain it: the
    words of a row of `OF_MISFIT`, by its name."""
    result = fit.solution
    if result.freedom == 0:
        return {"no redundancy": {}}
    bad = result.freedom > 0 and result.p_value < RARE
    away_deg = np.degrees(np.linalg.norm(find_way_from_nominal(fit.session, result)))
    sd_deg = np.inf if fit.session.mounting is None else fit.session.mounting.sd_deg
    if not bad and away_deg <= 4.0 * sd_deg:
        return {}
    seen = (
        f"the residuals are {figure(fit.residual_rms, 3)} nT rms, "
        f"{figure(float(np.sqrt(result.chi2 / result.freedom)))} times what the noise explains"
        if bad
        else f"the alignment is {figure(float(away_deg), 3)}° from the nominal mounting"
    )
    mistakes = find_likely_mistakes(fit.session, fit.solve, compute_misfit(fit.session, result))
    if mistakes:
        return {"session mistake": describe_misfit(seen, mistakes)}
    if not bad:
        return {"nominal mounting": {"what": seen}}
    times = fit.observed.time, fit.observed.orientation
    found = find_explanations(result, *times, fit.session.site)
    return {
        "session misfit": describe_misfit(
            seen if found else f"{seen}; none of the usual mistakes explains it",
            found,
            "look at the residuals of each orientation; solve for the magnetometer's bias and "
            "matrix, or for the pier",
        )
    }


def _find_loose(fit: AlignmentFit) -> Told:
    if is_spoilt(fit) or not fit.worst_sd_arcsec > fit.wanted_sd_arcsec:
        return None
    more = write_additions(fit.add)
    return {"sd": fit.worst_sd_arcsec, "wanted": fit.wanted_sd_arcsec, "action": more}


def _find_unchecked(fit: AlignmentFit) -> Told:
    """By how many times the standard error a small turn of the reference would move the alignment
    unseen. Not where the reference's axes are solved for or known to a stated standard deviation:
    then the standard error contains their turn."""
    if is_spoilt(fit) or "reference" in fit.solution.groups:
        return None
    prior = fit.solution.prior.copy()
    prior[GROUPS["reference"]] = 1 / (DOUBTED_ARCSEC * ARCSEC_RAD) ** 2
    doubted = compute_turn_sd(invert(fit.solution.information, prior)) / ARCSEC_RAD
    worse = doubted / max(fit.worst_sd_arcsec, fit.wanted_sd_arcsec)
    prior[GROUPS["reference"]] = 0.0
    more = write_additions(_suggest_orientations(fit, replace(fit.solution, prior=prior)))
    return {"value": worse, "by": DOUBTED_ARCSEC, "off": doubted, "action": more}


def _find_scatter(fit: AlignmentFit) -> Told:
    """How many times more attitudes scatter within the orientations than their covariance says."""
    covariance, seen = fit.session.star.covariance, fit.observed.star_noise
    freedom = int((fit.observed.readings[:, 0] - 1).sum())
    if covariance is None or freedom < 10 or not np.isfinite(seen).all():
        return None
    stated = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2).mean(axis=0))
    ratio = seen / np.array([np.hypot(stated[0], stated[1]) / np.sqrt(2), stated[2]])
    if not (chdtrc(freedom, freedom * ratio**2) < RARE).any():
        return None
    return {"value": float(ratio.max()), "which": ("across", "about")[int(ratio.argmax())]}


def _find_prediction(fit: AlignmentFit) -> Told:
    """Where the Earth's rotation is predicted, how well."""
    earth, middle = load_earth_rotation(), fit.session.middle
    if middle <= earth.measured_until:
        return None
    sd = earth.sd_arcsec(middle)
    newer = "install a newer astropy-iers-data and fit again" if sd > 0.5 else ""
    return {"date": fit.session.date, "sd": sd, "action": newer}


def _find_pole(fit: AlignmentFit) -> Told:
    beta = fit.angles_deg[1]
    if not min(beta, 180.0 - beta) < 1.0:
        return None
    return {"known": "sum" if beta < 90 else "difference"}


OF_UNKNOWNS = (
    Fact("alignment undetermined", _find_spoilt, "refuse", "{what}", "{action}"),
    Fact(
        "unknowns undetermined",
        _find_undetermined,
        "check",
        "{what}; the alignment itself is determined",
        "{action}",
    ),
)
OF_MISFIT = (
    Fact(
        "no redundancy",
        _name("no redundancy"),
        "check",
        "orientations just enough for the unknowns: a mistake would not be noticed",
        "add orientations",
    ),
    Fact("session mistake", _name("session mistake"), "refuse", "{what}", "{action}"),
    Fact("session misfit", _name("session misfit"), "check", "{what}", "{action}"),
    Fact(
        "nominal mounting",
        _name("nominal mounting"),
        "check",
        "{what}",
        "check the nominal angles and the axes",
    ),
)
OF_FIT = (
    Fact(
        "alignment loose",
        _find_loose,
        "check",
        "the alignment is known to {sd}″ about its worst axis, not to {wanted:g}″",
        "{action}",
    ),
    Fact(
        "below the horizon",
        lambda fit: {"value": int((fit.observed.elevation_deg < 0).sum()), "n": fit.n},
        Limit(check=0),
        "the star sensor looks below the horizon in {value} of {n} orientations",
        "check longitude, time scale and the sense of the attitudes",
    ),
    Fact(
        "attitude scatter",
        _find_scatter,
        Limit(check=1.3),  # times what is stated
        "within the orientations the attitudes scatter {value} times as much {which} the boresight "
        "as stated",
        "let the platform settle, check the numbers of the orientations, or state a larger sd",
    ),
    Fact(
        "reference unchecked",
        _find_unchecked,
        Limit(check=1.5),  # times the stated or the wanted standard error
        "these orientations do not show whether the reference's axes and the clocks are right: "
        "were they off by {by:g}″ (0.7 s of a clock), the alignment would be off by up to {off}″, "
        "and no residual would show it",
        "{action}; or state how well north and the clocks are known (axes_sd_arcsec of the "
        "reference; a second is 15″)",
    ),
)
OF_SURROUNDINGS = (
    Fact(
        "geodetic coordinates",
        lambda fit: {} if fit.session.site.coordinates == "geodetic" else None,
        "check",
        DEFLECTION,
        "give astronomical coordinates, or solve for the reference",
    ),
    Fact(
        "predicted earth rotation",
        _find_prediction,
        "note",
        "the Earth's rotation on {date} is predicted, not measured, by the installed table, which "
        "may be off by {sd}″",
        "{action}",
    ),
    Fact(
        "near-zero beta",
        _find_pole,
        "note",
        "the third axes of star sensor and magnetometer are nearly parallel, so only the {known} "
        "of α and γ is determined; quaternion and matrix are good",
    ),
)
