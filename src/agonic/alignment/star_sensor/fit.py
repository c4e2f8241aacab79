"""`fit_alignment`: the rotation from a star sensor to a magnetometer, and its standard error.

A wrong clock, longitude, latitude and variometer all turn the reference's axes. Where the platform
is turned about one axis only, such a turn is part of the alignment, and no residual shows it (the
external reliability of the net, in the words of geodesy).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice, takewhile

import numpy as np
from scipy.special import chdtrc

from agonic.alignment.calibration import make_calibration, make_provenance
from agonic.alignment.explanations import find_explanations, report_misfit
from agonic.alignment.findings import is_above, report, report_above
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
from agonic.alignment.session.observed import observe, solve_session
from agonic.alignment.session.session import Session, check_session
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
from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Validity
from agonic.calibration.chain import Chain
from agonic.errors import check_choice
from agonic.health import Finding, figure
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
    """What is undetermined, what does not fit, and what else to know of session and platform."""
    lost = fit.solution.undetermined[GROUPS["alignment"]]
    # with a share in what is undetermined the alignment is so too
    spoilt = bool((lost**2).sum(axis=0).max(initial=0.0) > 1e-3)
    if fit.undetermined:
        yield _report_undetermined(fit, spoilt)
    doubt = None if spoilt else _check_misfit(fit)
    if doubt is not None:
        yield doubt
    else:  # else these are what the same cause does
        if not spoilt and fit.worst_sd_arcsec > fit.wanted_sd_arcsec:
            yield report(
                "alignment loose",
                sd=fit.worst_sd_arcsec,
                wanted=fit.wanted_sd_arcsec,
                action=write_additions(fit.add),
            )
        low = int((fit.observed.elevation_deg < 0).sum())
        yield from report_above("below the horizon", low, low=low, n=fit.n)
        yield from _check_scatter(fit)
        if not spoilt:
            yield from _check_reference(fit)
    yield from _check_surroundings(fit)


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


def _report_undetermined(fit: AlignmentFit, spoilt: bool) -> Finding:
    """Combinations that nothing determines: some that matter to the alignment, others not."""
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
    action = elsewhere if stuck else write_additions(fit.add)
    name = "alignment undetermined" if spoilt else "unknowns undetermined"
    return report(name, what=said, action=action)


def _check_misfit(fit: AlignmentFit) -> Finding | None:
    """Residuals too large, or an alignment far from the nominal one, and what would explain it."""
    result = fit.solution
    if result.freedom == 0:
        return report("no redundancy")
    bad = result.freedom > 0 and result.p_value < RARE
    away_deg = np.degrees(np.linalg.norm(find_way_from_nominal(fit.session, result)))
    sd_deg = np.inf if fit.session.mounting is None else fit.session.mounting.sd_deg
    if not (bad or is_above("nominal mounting", float(away_deg / sd_deg))):
        return None
    seen = (
        f"the residuals are {figure(fit.residual_rms, 3)} nT rms, "
        f"{figure(float(np.sqrt(result.chi2 / result.freedom)))} times what the noise explains"
        if bad
        else f"the alignment is {figure(float(away_deg), 3)}° from the nominal mounting"
    )
    mistakes = find_likely_mistakes(fit.session, fit.solve, compute_misfit(fit.session, result))
    if mistakes:
        return report_misfit("session mistake", seen, mistakes)
    if not bad:
        return report("nominal mounting", what=seen)
    times = fit.observed.time, fit.observed.orientation
    found = find_explanations(result, *times, fit.session.site)
    return report_misfit(
        "session misfit",
        seen if found else f"{seen}; none of the usual mistakes explains it",
        found,
        "look at the residuals of each orientation; solve for the magnetometer's bias and matrix, "
        "or for the pier",
    )


def _check_reference(fit: AlignmentFit) -> Iterator[Finding]:
    """Whether a small turn of the reference would move the alignment unseen. Not where the
    reference's axes are solved for or known to a stated standard deviation: then the standard error
    contains their turn."""
    if "reference" in fit.solution.groups:
        return
    prior = fit.solution.prior.copy()
    prior[GROUPS["reference"]] = 1 / (DOUBTED_ARCSEC * ARCSEC_RAD) ** 2
    doubted = compute_turn_sd(invert(fit.solution.information, prior)) / ARCSEC_RAD
    worse = doubted / max(fit.worst_sd_arcsec, fit.wanted_sd_arcsec)
    if is_above("reference unchecked", worse):
        prior[GROUPS["reference"]] = 0.0
        more = write_additions(_suggest_orientations(fit, replace(fit.solution, prior=prior)))
        yield report("reference unchecked", by=DOUBTED_ARCSEC, off=doubted, action=more)


def _check_scatter(fit: AlignmentFit) -> Iterator[Finding]:
    """Attitudes that scatter more within the orientations than their covariance says."""
    covariance, seen = fit.session.star.covariance, fit.observed.star_noise
    freedom = int((fit.observed.readings[:, 0] - 1).sum())
    if covariance is None or freedom < 10 or not np.isfinite(seen).all():
        return
    stated = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2).mean(axis=0))
    ratio = seen / np.array([np.hypot(stated[0], stated[1]) / np.sqrt(2), stated[2]])
    if (chdtrc(freedom, freedom * ratio**2) < RARE).any():
        worst, which = float(ratio.max()), ("across", "about")[int(ratio.argmax())]
        yield from report_above("attitude scatter", worst, ratio=worst, which=which)


def _check_surroundings(fit: AlignmentFit) -> Iterator[Finding]:
    """Where north is, how the Earth stands, the angles' pole, and what the platform adds. A bias
    that is solved for contains the platform's field."""
    if fit.session.site.coordinates == "geodetic":
        yield report("geodetic coordinates", otherwise=", or solve for the reference")
    earth, middle = load_earth_rotation(), fit.session.middle
    if middle > earth.measured_until:
        sd = earth.sd_arcsec(middle)
        newer = "install a newer astropy-iers-data and fit again" if sd > 0.5 else ""
        yield report("predicted earth rotation", date=fit.session.date, sd=sd, action=newer)
    beta = fit.angles_deg[1]
    if min(beta, 180.0 - beta) < 1.0:
        yield report("near-zero beta", known="sum" if beta < 90 else "difference")
    solved = {"platform remanence": "bias", "platform iron": "matrix"}
    for found in () if fit.platform is None else fit.platform.findings:
        known = solved.get(found.name) in fit.solve
        yield replace(found, severity="note", move="") if known else found


METHOD = ("harbin-2018", "iers-2010")


def fit_alignment(
    session: Session,
    *,
    solve: Sequence[str] = ("alignment",),
    wanted_sd_arcsec: float = 2.0,
) -> AlignmentFit:
    """The rotation from the axes of a star sensor to those of a magnetometer on one platform.

    Of every orientation of the platform the residual

        W (raw − bias) − R_mc R_ci R_ie R_en H (B_ref + O)

    is made as small as its noise by Levenberg–Marquardt: R_ci is what the star sensor reads, R_ie
    the Earth's orientation (ERFA with the tables of the IERS), R_en the site, H the axes of the
    reference and O the difference of the field between the piers. R_mc, and what else is solved
    for, changes by small rotation vectors, so no angle is singular.

    Parameters
    ----------
    session : readings and site (`read_session`).
    solve : "alignment", and further "reference" (its axes), "pier" (O), "bias" and "matrix" (of the
        magnetometer, symmetric). What the session knows with a standard deviation joins by itself.
    wanted_sd_arcsec : above this the fit says which orientations to add.

    Returns an `AlignmentFit`; its findings say what is undetermined, and which usual mistake would
    explain a bad fit. Raises `AgonicError` for readings that cannot belong together, and
    `ValidityError` where the table of the Earth's rotation ends before the session.

    Source: patent CN 108871301 B, equations 1 to 11; IERS Conventions 2010, chapter 5.

    >>> from agonic.alignment.simulation.session import simulate_session
    >>> made = simulate_session(seed=1)
    >>> fit = fit_alignment(made.session)
    >>> fit.verdict, bool(fit.worst_sd_arcsec < 2.0)
    ('good', True)
    """
    for group in solve:
        check_choice("solve", group, tuple(GROUPS))
    asked = tuple(group for group in GROUPS if group in solve or group == "alignment")
    checked = check_session(session)
    observed = observe(checked)
    solution = solve_session(checked, observed, asked)
    fit = AlignmentFit(
        calibration=_calibration(checked, solution, asked),
        session=checked,
        observed=observed,
        solution=solution,
        solve=asked,
        wanted_sd_arcsec=wanted_sd_arcsec,
    )
    return examine(fit)


def _calibration(session: Session, solution: Solution, solve: tuple[str, ...]) -> Alignment | Chain:
    """From the magnetometer's readings to the field in the star sensor's axes."""
    star, samples, site = session.star, session.magnetometer, session.site
    arrays = {star.name: star.rot_ci.reshape(-1, 9)}
    arrays |= {one.name: one.field for one in session.instruments}
    settings = {
        "fit": "alignment",
        "solve": ", ".join(solve),
        "latitude_deg": site.latitude_deg,
        "longitude_deg": site.longitude_deg,
        "coordinates": site.coordinates,
        "date": session.date,
        "refraction": star.refraction,
        "aberration": star.aberration,
    }
    provenance = make_provenance(session.sources, arrays, settings, *METHOD)
    own, last = None, slice(GROUPS["bias"].start, None)
    if {"bias", "matrix"} & set(solve):
        own = Affine(
            bias=solution.unknowns.bias,
            matrix=solution.unknowns.matrix,
            covariance=solution.covariance[last, last],
            magnitude=solution.magnitude,
            noise=session.noise,
            sensor=samples.name,
            validity=Validity(largest_reading=float(np.abs(samples.field).max())),
            provenance=provenance,
        )
    return make_calibration(
        solution.unknowns.rot_mc,
        solution.covariance[:3, :3],
        samples,
        provenance,
        frame="c",
        before=session.calibration,
        own=own,
    )
