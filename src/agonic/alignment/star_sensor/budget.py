"""What a direction of the field from a star sensor rests on, effect by effect, with sizes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import erfa
import numpy as np
from scipy.spatial.transform import Rotation

from agonic.alignment.session.earth import ARCSEC_PER_S, load_earth_rotation
from agonic.alignment.session.observed import compute_apparent_turn
from agonic.alignment.session.session import PRESENT, REMOVED, Session
from agonic.alignment.star_sensor.result import AlignmentFit
from agonic.arrays import Array
from agonic.maths.earth.earth_rotation import TT_TAI_S, UNIX_JD, tai_utc_s
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.units import DAY_S

Treatment = Literal["corrected", "by the sensor", "solved for", "not corrected", "not known"]

STANDARD_ERROR = "standard error"


@dataclass(frozen=True)
class Effect:
    """One line of the budget: what it is, its size at this session, and what was done about it."""

    name: str
    size_arcsec: float
    treatment: Treatment
    remark: str = ""


def error_budget(fit: AlignmentFit) -> tuple[Effect, ...]:
    """Every effect between the stars and the magnetometer with its size, the corrected ones first.

    Sizes of corrected effects say what leaving them out would cost; those of the others, by how
    much the direction may be wrong.

    Source: IERS Conventions 2010, chapter 5, for the Earth; ERFA for light; the fit for the rest.

    >>> from agonic.alignment.star_sensor.fit import fit_alignment
    >>> from agonic.alignment.simulation.session import simulate_session
    >>> budget = error_budget(fit_alignment(simulate_session().session))
    >>> [(effect.name, round(effect.size_arcsec)) for effect in budget if effect.size_arcsec > 1000]
    [('precession', 1217), ('equation of the origins', 1112)]
    """
    earth, light = _of_the_earth(fit.session), _of_light(fit.session)
    return (*earth, *light, *_of_the_site(fit), *_of_the_readings(fit))


def _of_the_earth(session: Session) -> tuple[Effect, ...]:
    """Precession, nutation, rotation and polar motion at the middle of the session."""
    earth, when = load_earth_rotation(), session.middle
    ut1_tai, x, y = (float(value[0]) for value in earth.at(when))
    leap = float(tai_utc_s(when)[()])
    tt = (when + leap + TT_TAI_S) / DAY_S
    precession = _angle(erfa.pmat06(UNIX_JD, tt) @ erfa.pmat06(erfa.DJ00, 0.0).T)
    nutation = _angle(erfa.num06a(UNIX_JD, tt))
    origins = abs(erfa.gst06a(UNIX_JD, tt, UNIX_JD, tt) - erfa.era00(UNIX_JD, tt)) / ARCSEC_RAD
    pole = float(np.hypot(x, y)) / ARCSEC_RAD
    ut1_utc = ut1_tai + leap
    turned = "GAST less the Earth rotation angle"
    return (
        Effect("precession", precession, "corrected", "since J2000"),
        Effect("nutation", nutation, "corrected"),
        Effect("equation of the origins", origins % 1_296_000.0, "corrected", turned),
        Effect("leap seconds", leap * ARCSEC_PER_S, "corrected", f"TAI − UTC {leap:.0f} s"),
        Effect("UT1 − UTC", abs(ut1_utc) * ARCSEC_PER_S, "corrected", f"{ut1_utc:+.4f} s"),
        Effect("polar motion", pole, "corrected"),
        Effect(
            "errors of the Earth rotation table",
            earth.sd_arcsec(when),
            "not corrected",
            earth.source,
        ),
    )


def _angle(matrix: Array) -> float:
    """The angle of a rotation, or the largest of several, arcseconds."""
    return float(np.max(Rotation.from_matrix(matrix).magnitude()) / ARCSEC_RAD)


def _of_light(session: Session) -> Iterator[Effect]:
    """Refraction and aberration, by how much they turn the attitudes at most."""
    said = {
        "refraction": "refraction of the air",
        "aberration": "annual and diurnal aberration",
    }
    rot_ei = load_earth_rotation().rot_ei(session.star.time)
    for effect, name in said.items():
        alone: dict[str, Any] = dict.fromkeys(said, REMOVED) | {effect: PRESENT}
        turns = compute_apparent_turn(session.site, replace(session.star, **alone), rot_ei)
        present = getattr(session.star, effect) == PRESENT
        stated = "" if present else "; if the sensor removes it as stated"
        done: Treatment = "corrected" if present else "by the sensor"
        yield Effect(name, _angle(turns), done, f"largest of the session{stated}")


def _of_the_site(fit: AlignmentFit) -> tuple[Effect, ...]:
    """Where north and down are, at the site and for the reference; the two piers; the platform. A
    difference of the piers is corrected only where one is given; of the platform's own field the
    readings with it turned show it."""
    session, groups, pier = fit.session, fit.solution.groups, fit.session.pier
    plumb, platform = session.site.coordinates == "astronomical", fit.platform
    axes = float(fit.sd[3:6].max()) / ARCSEC_RAD
    apart = float(fit.sd[6:9].max()) / fit.solution.magnitude / ARCSEC_RAD
    known = "astronomical coordinates contain it" if plumb else "the coordinates are geodetic"
    unsolved = "taken as exactly north, east, down: their error goes into the result"
    given = "taken as exact" if pier.difference.any() else "none was given"
    given = STANDARD_ERROR if apart else f"{given}: 0.24 nT are 1″ at 50 000 nT"
    size, remark = 0.0, "turn it beneath a magnetometer that stands still: agonic fit remanence"
    if platform is not None:
        size = platform.size_arcsec + 2 * platform.sd_arcsec
        remark = f"at most, from {platform.n} settings; across the axis of the turn"
    stated = pier.difference.any() or pier.sd is not None

    def treat(group: str, otherwise: Treatment) -> Treatment:
        return "solved for" if group in groups else otherwise

    between = treat("pier", "corrected" if stated else "not known")
    own = treat("bias", "not corrected" if platform else "not known")
    plumbed: Treatment = "corrected" if plumb else "not corrected"
    turned = STANDARD_ERROR if axes else unsolved
    return (
        Effect("deflection of the vertical", 20.0, plumbed, f"at most; {known}"),
        Effect("axes of the reference", axes, treat("reference", "not known"), turned),
        Effect("difference between the piers", apart, between, given),
        Effect("remanence of the platform", size, own, remark),
    )


def _of_the_readings(fit: AlignmentFit) -> Iterator[Effect]:
    """What the means of an orientation are uncertain by, and the magnetometer's own errors."""
    measured, magnitude = fit.solution.measured, fit.solution.magnitude
    variances = np.diagonal(measured.attitude_covariance, axis1=1, axis2=2).mean(axis=0)
    stars = np.sqrt(variances) / ARCSEC_RAD
    own, beside = (
        float(np.sqrt((sd**2).mean())) / magnitude / ARCSEC_RAD
        for sd in (measured.noise, measured.reference_noise)
    )
    for name, size in (
        ("star sensor, across", stars[:2].max()),
        ("star sensor, about the boresight", stars[2]),
        ("magnetometer", own),
        ("reference", beside),
    ):
        of = "of the mean of an orientation"
        yield Effect(f"noise of the {name}", float(size), "not corrected", of)
    solved, known = "matrix" in fit.solution.groups, fit.session.calibration is not None
    remark = "by its calibration" if known else "taken as exact: none was given"
    yield Effect(
        "bias and matrix of the magnetometer",
        float(fit.sd[9:].max() and fit.sd[12:].max() / ARCSEC_RAD),
        "solved for" if solved else "corrected" if known else "not known",
        "standard error of an entry" if solved else remark,
    )
