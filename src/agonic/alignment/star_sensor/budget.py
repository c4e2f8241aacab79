"""What a direction of the field from a star sensor rests on, effect by effect, with sizes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import erfa
import numpy as np

from agonic.alignment.session import Session, load_earth_rotation
from agonic.alignment.session.observed import compute_apparent_turn
from agonic.alignment.session.session import PRESENT, REMOVED
from agonic.alignment.star_sensor.result import AlignmentFit
from agonic.arrays import Array
from agonic.maths.earth.earth_rotation import TT_TAI_S, UNIX_JD, tai_utc_s
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.units import DAY_S

Treatment = Literal["corrected", "by the sensor", "solved for", "not corrected", "not known"]

ARCSEC_PER_S = 15.041067
_J2000_TT = (2_451_545.0, 0.0)
DEFLECTION_ARCSEC = 20.0


@dataclass(frozen=True, kw_only=True)
class Effect:
    """One line of the budget: what it is, its size at this session, and what was done about it."""

    name: str
    size_arcsec: float
    treatment: Treatment
    remark: str = ""

    def size_nT(self, magnitude: float) -> float:
        """What it amounts to in a field of that magnitude."""
        return self.size_arcsec * ARCSEC_RAD * magnitude


def error_budget(fit: AlignmentFit) -> tuple[Effect, ...]:
    """Every effect between the stars and the magnetometer with its size, the corrected ones first.

    Sizes of corrected effects say what leaving them out would cost; those of the others, by how
    much the direction may be wrong.

    Source: IERS Conventions 2010, chapter 5, for the Earth; ERFA for light; the fit for the rest.

    >>> from agonic.alignment.star_sensor import fit_alignment
    >>> from agonic.alignment.simulation.session import simulate_session
    >>> budget = error_budget(fit_alignment(simulate_session().session))
    >>> [(effect.name, round(effect.size_arcsec)) for effect in budget if effect.size_arcsec > 1000]
    [('precession', 1217), ('equation of the origins', 1112)]
    """
    return (
        *_of_the_earth(fit.session),
        *_of_light(fit.session),
        *_of_the_site(fit),
        *_of_the_readings(fit),
    )


def _of_the_earth(session: Session) -> tuple[Effect, ...]:
    """Precession, nutation, rotation and polar motion at the middle of the session."""
    earth, when = load_earth_rotation(), session.middle
    ut1_tai, x, y = (float(value[0]) for value in earth.at(when))
    leap = float(tai_utc_s(when)[()])
    tt = (when + leap + TT_TAI_S) / DAY_S
    precession = _angle(erfa.pmat06(UNIX_JD, tt) @ erfa.pmat06(*_J2000_TT).T)
    nutation = _angle(erfa.num06a(UNIX_JD, tt))
    origins = abs(erfa.gst06a(UNIX_JD, tt, UNIX_JD, tt) - erfa.era00(UNIX_JD, tt)) / ARCSEC_RAD
    pole = float(np.hypot(x, y)) / ARCSEC_RAD
    return (
        Effect(
            name="precession", size_arcsec=precession, treatment="corrected", remark="since J2000"
        ),
        Effect(name="nutation", size_arcsec=nutation, treatment="corrected"),
        Effect(
            name="equation of the origins",
            size_arcsec=origins % 1_296_000.0,
            treatment="corrected",
            remark="GAST less the Earth rotation angle",
        ),
        Effect(
            name="leap seconds",
            size_arcsec=leap * ARCSEC_PER_S,
            treatment="corrected",
            remark=f"TAI − UTC {leap:.0f} s",
        ),
        Effect(
            name="UT1 − UTC",
            size_arcsec=abs(ut1_tai + leap) * ARCSEC_PER_S,
            treatment="corrected",
            remark=f"{ut1_tai + leap:+.4f} s",
        ),
        Effect(name="polar motion", size_arcsec=pole, treatment="corrected"),
        Effect(
            name="errors of the Earth rotation table",
            size_arcsec=earth.sd_arcsec(when),
            treatment="not corrected",
            remark=earth.source,
        ),
    )


def _angle(matrix: Array) -> float:
    """The angle of a rotation, arcseconds."""
    off = np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )
    return float(np.arcsin(min(float(np.linalg.norm(off)) / 2, 1.0)) / ARCSEC_RAD)


def _of_light(session: Session) -> tuple[Effect, ...]:
    """Refraction and aberration, by how much they turn the attitudes at most."""
    said = {
        "refraction": "refraction of the air",
        "aberration": "annual and diurnal aberration",
    }
    rot_ei = load_earth_rotation().rot_ei(session.star.time)
    effects = []
    for effect, name in said.items():
        alone: dict[str, Any] = dict.fromkeys(said, REMOVED) | {effect: PRESENT}
        turns = compute_apparent_turn(session.site, replace(session.star, **alone), rot_ei)
        largest = max(_angle(turn) for turn in turns)
        present = getattr(session.star, effect) == PRESENT
        effects.append(
            Effect(
                name=name,
                size_arcsec=largest,
                treatment="corrected" if present else "by the sensor",
                remark="largest of the session"
                + ("" if present else "; if the sensor removes it as stated"),
            )
        )
    return tuple(effects)


def _of_the_site(fit: AlignmentFit) -> tuple[Effect, ...]:
    """Where north and down are, at the site and for the reference; the two piers."""
    session, magnitude = fit.session, fit.solution.magnitude
    plumb = session.site.coordinates == "astronomical"
    axes = fit.sd[3:6].max() / ARCSEC_RAD
    pier = float(fit.sd[6:9].max()) / magnitude / ARCSEC_RAD
    return (
        Effect(
            name="deflection of the vertical",
            size_arcsec=DEFLECTION_ARCSEC,
            treatment="corrected" if plumb else "not corrected",
            remark="at most; astronomical coordinates contain it"
            if plumb
            else "at most; the coordinates are geodetic",
        ),
        Effect(
            name="axes of the reference",
            size_arcsec=float(axes),
            treatment="solved for" if "reference" in fit.solution.groups else "not known",
            remark="standard error"
            if axes
            else "taken as exactly north, east, down: what they are off goes into the result",
        ),
        Effect(
            name="difference between the piers",
            size_arcsec=pier,
            treatment=_about_pier(fit),
            remark="standard error"
            if pier
            else "taken as exact: 0.24 nT are 1″ at 50 000 nT"
            if session.pier.difference.any()
            else "none was given: 0.24 nT are 1″ at 50 000 nT",
        ),
        _of_the_platform(fit),
    )


def _about_pier(fit: AlignmentFit) -> Treatment:
    """What was done about the difference between the piers: corrected only where one is given."""
    if "pier" in fit.solution.groups:
        return "solved for"
    pier = fit.session.pier
    return "corrected" if pier.difference.any() or pier.sd is not None else "not known"


def _of_the_platform(fit: AlignmentFit) -> Effect:
    """The platform's own field, by the readings with it turned."""
    name, platform = "remanence of the platform", fit.platform
    if platform is None:
        return Effect(
            name=name,
            size_arcsec=0.0,
            treatment="solved for" if "bias" in fit.solution.groups else "not known",
            remark="turn it beneath a magnetometer that stands still: agonic fit remanence",
        )
    return Effect(
        name=name,
        size_arcsec=platform.size_arcsec + 2 * platform.sd_arcsec,
        treatment="solved for" if "bias" in fit.solution.groups else "not corrected",
        remark=f"at most, from {platform.n} settings; across the axis of the turn",
    )


def _of_the_readings(fit: AlignmentFit) -> tuple[Effect, ...]:
    """What the means of an orientation are uncertain by, and the magnetometer's own errors."""
    measured, magnitude = fit.solution.measured, fit.solution.magnitude
    stars = (
        np.sqrt(np.diagonal(measured.attitude_covariance, axis1=1, axis2=2).mean(axis=0))
        / ARCSEC_RAD
    )
    own, beside = (
        float(np.sqrt((sd**2).mean())) / magnitude / ARCSEC_RAD
        for sd in (measured.noise, measured.reference_noise)
    )
    solved = "matrix" in fit.solution.groups
    known = fit.session.calibration is not None
    return (
        Effect(
            name="noise of the star sensor, across",
            size_arcsec=float(stars[:2].max()),
            treatment="not corrected",
            remark="of the mean of an orientation",
        ),
        Effect(
            name="noise of the star sensor, about the boresight",
            size_arcsec=float(stars[2]),
            treatment="not corrected",
            remark="of the mean of an orientation",
        ),
        Effect(
            name="noise of the magnetometer",
            size_arcsec=own,
            treatment="not corrected",
            remark="of the mean of an orientation",
        ),
        Effect(
            name="noise of the reference",
            size_arcsec=beside,
            treatment="not corrected",
            remark="of the mean of an orientation",
        ),
        Effect(
            name="bias and matrix of the magnetometer",
            size_arcsec=float(fit.sd[9:].max() and fit.sd[12:].max() / ARCSEC_RAD),
            treatment="solved for" if solved else "corrected" if known else "not known",
            remark="standard error of an entry"
            if solved
            else "by its calibration"
            if known
            else "taken as exact: none was given",
        ),
    )
