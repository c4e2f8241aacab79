"""`fit_north`: true north by a gyrotheodolite, and what is pointed by it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any, NamedTuple

import numpy as np

from agonic.alignment.calibration import make_calibration, make_provenance
from agonic.alignment.explanations import describe_misfit, find_explanations
from agonic.alignment.maths import north as kernel
from agonic.alignment.maths.north import North, Swing
from agonic.alignment.maths.two_frames import RARE
from agonic.alignment.north.platform import Aligned, align_platform
from agonic.alignment.session.laboratory import NorthSession, Sighting
from agonic.calibration.alignment import Alignment
from agonic.calibration.chain import Chain
from agonic.health import Finding, Judged, figure
from agonic.health.finding import Fact, Limit, Told, find_facts
from agonic.maths.estimation.inference import average_over_term
from agonic.maths.rotations.angles import wrap_deg
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.readable import Shown


class Drift(NamedTuple):
    """How far the zero moves over the readings, and its standard error, degrees; infinite where
    nothing shows it."""

    size_deg: float = 0.0
    sd_deg: float = float("inf")

    @property
    def allowed_deg(self) -> float:
        """What is to be allowed for: an average over its being there and not, as likely as each
        other before the readings are seen: gyros warm up."""
        if not 0 < self.sd_deg < np.inf:
            return 0.0
        mean, variance = np.array([self.size_deg]), np.array([[self.sd_deg**2]])
        found = average_over_term(mean, variance, slice(0, 1), 0.5)
        return float(np.hypot(found.params[0], np.sqrt(max(found.covariance[0, 0], 0.0))))


@dataclass(frozen=True, kw_only=True)
class Azimuth:
    """The azimuth of a sighting, degrees clockwise from true north; standard error in arcseconds.
    `collimation_arcsec` is the theodolite's, NaN where one face only was read; `excess` is how many
    times the stated noise the readings scatter, 1 where chance explains it."""

    name: Annotated[str, Shown()]
    azimuth_deg: Annotated[float, Shown()]
    sd_arcsec: Annotated[float, Shown()]
    collimation_arcsec: Annotated[float, Shown()]
    excess: Annotated[float, Shown()] = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class NorthFit(Judged):
    """The result of `fit_north`.

    Parameters
    ----------
    by : what each method gives, the gyro's north on the circle: "swing", "reversal", "transit".
    method : the one with the smallest standard error, which the rest goes by.
    swing : the damped sinusoid. drift : of the gyro's zero, as the readings show it.
    constant, constant_sd : c of the transits, degrees per (unit · s).
    azimuths : of what was sighted.
    aligned : the magnetometer's alignment with the platform; `calibration` the same to save.
    """

    session: NorthSession
    by: Annotated[dict[str, North], Shown()]
    method: str
    drift: Drift
    swing: Swing | None = None
    constant: Annotated[float | None, Shown(key="transit_constant")] = None
    constant_sd: Annotated[float | None, Shown(key="transit_constant_sd")] = None
    azimuths: Annotated[tuple[Azimuth, ...], Shown()] = ()
    aligned: Aligned | None = None
    calibration: Alignment | Chain | None = None
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def north_deg(self) -> Annotated[float, Shown()]:
        """The circle's reading at true north: the gyro's, with the instrument's constant."""
        gyro = self.by[self.method].reading_deg
        return (gyro + self.session.constant_arcsec / 3600.0) % 360.0

    @property
    def sd_arcsec(self) -> Annotated[float, Shown(key="north_sd_arcsec")]:
        """Its standard error, the constant's included."""
        own = self.by[self.method].sd_arcsec
        return float(np.hypot(own, self.session.constant_sd_arcsec))

    @property
    def period_s(self) -> Annotated[float | None, Shown()]:
        """The period of the swing."""
        return None if self.swing is None else float(2 * np.pi / self.swing.params[4])


METHOD = ("harbin-2018",)


def fit_north(session: NorthSession) -> NorthFit:
    """True north on the circle of a gyrotheodolite, and azimuths from it.

    By turning points N is the mean of (u_i + 2 u_{i+1} + u_{i+2})/4; by transits
    N = N′ + c a Δt, with c from two settings or known; by the whole record the N of a damped
    sinusoid. The one with the smallest standard error is used; the instrument's constant is added.

    Parameters
    ----------
    session : readings (`read_north`), sightings, and perhaps a platform with a magnetometer.

    Returns a `NorthFit`. Raises `AgonicError` for readings that cannot belong together.

    Source: patent CN 108871301 B; the Schuler mean after M. Schuler (1932).

    >>> from agonic.alignment.simulation.laboratory import simulate_north
    >>> made = simulate_north(seed=1)
    >>> fit = fit_north(made.session)
    >>> fit.method, bool(abs(fit.north_deg - made.north_deg) * 3600 < 4 * fit.sd_arcsec)
    ('swing', True)
    """
    fit = _find_north(session)
    azimuths = tuple(_azimuth(fit, sighting) for sighting in session.sightings)
    whole = replace(fit, azimuths=azimuths)
    if session.platform is not None:
        found = align_platform(session, fit.north_deg, fit.sd_arcsec)
        settings = {"method": fit.method, "constant_arcsec": session.constant_arcsec}
        arrays = {one.name: one.field for one in session.instruments}
        calibration = make_calibration(
            found.rot_mb,
            found.covariance,
            session.instruments[0],
            make_provenance(session.sources, arrays, {"fit": "north", **settings}, *METHOD),
            frame="b",
            before=session.calibration,
        )
        whole = replace(whole, aligned=found, calibration=calibration)
    judged = replace(whole, findings=tuple(_examine(whole)))
    return judged if judged.verdict == "refused" else replace(judged, remarks=_describe(judged))


def _find_north(session: NorthSession) -> NorthFit:
    """North by every method that there are readings for."""
    by: dict[str, North] = {}
    sd = None if session.reading_sd_arcsec is None else session.reading_sd_arcsec / 3600.0
    swing, constant, constant_sd, transits = None, None, None, session.transits
    if session.swing is not None:
        swing = kernel.fit_swing(session.swing.time_s, session.swing.reading_deg, sd)
        by["swing"] = swing.north
    if session.turning_deg is not None:
        by["reversal"] = kernel.fit_reversals(session.turning_deg, sd)
    if transits is not None:
        # of t1, t2, t3: Δt = (t2 − t1) − (t3 − t2), so its variance is (1 + 4 + 1) that of one
        amplitude = (transits.amplitude_east + transits.amplitude_west) / 2
        one_sd = session.time_sd_s
        by["transit"], constant, constant_sd = kernel.fit_transits(
            transits.setting_deg,
            amplitude * (transits.east_s - transits.west_s),
            None if one_sd is None else amplitude * np.sqrt(6.0) * one_sd,
            session.transit_constant,
            session.transit_constant_sd,
        )
    read = (by[name] for name in ("swing", "reversal") if name in by)
    known = (Drift(one.drift_deg, one.drift_sd_deg) for one in read)
    drift = next((one for one in known if np.isfinite(one.sd_deg)), Drift())
    # north is where the zero was at some moment of the record, and nobody knows at which
    by = {
        name: one._replace(sd_deg=float(np.hypot(one.sd_deg, drift.allowed_deg / 2)))
        for name, one in by.items()
    }
    return NorthFit(
        session=session,
        by=by,
        method=min(by, key=lambda name: (not np.isfinite(by[name].sd_deg), by[name].sd_deg)),
        swing=swing,
        drift=drift,
        constant=constant,
        constant_sd=constant_sd,
    )


def _azimuth(fit: NorthFit, sighting: Sighting) -> Azimuth:
    """Carried on the circle to what was sighted."""
    stated = fit.session.reading_sd_arcsec
    read = kernel.average_faces(sighting.reading_deg, stated and stated / 3600.0)
    back = 180.0 if sighting.mirror else 0.0
    return Azimuth(
        name=sighting.name,
        azimuth_deg=float((read.reading_deg - fit.north_deg + back) % 360.0),
        sd_arcsec=float(np.hypot(fit.sd_arcsec, 3600.0 * read.sd_deg)),
        collimation_arcsec=3600.0 * read.collimation_deg,
        excess=read.excess,
    )


def _examine(fit: NorthFit) -> Iterator[Finding]:
    """The findings of the gyro, of what was sighted, and of the platform."""
    yield from find_facts(OF_GYRO, fit)
    for one in fit.azimuths:
        yield from find_facts(OF_SIGHTING, one)
    if fit.aligned is not None:
        yield from find_facts(OF_PLATFORM, fit.aligned)


def _compare_methods(fit: NorthFit) -> Told:
    """The method whose north is most standard errors from the one that is used."""
    best = fit.by[fit.method]

    def compare(name: str) -> dict[str, Any]:
        apart = abs(float(wrap_deg(fit.by[name].reading_deg - best.reading_deg)))
        sd = float(np.hypot(fit.by[name].sd_deg, best.sd_deg))
        sds = apart / max(sd, 1e-12) if np.isfinite(sd) else 0.0  # no scatter shows an error
        return {"value": sds, "one": fit.method, "other": name, "by": 3600 * apart}

    return max(map(compare, fit.by), key=lambda one: float(one["value"]))


def _find_short_swing(fit: NorthFit) -> Told:
    if fit.swing is None or fit.session.swing is None or fit.period_s is None:
        return None
    periods = float(np.ptp(fit.session.swing.time_s)) / fit.period_s
    return periods if not fit.swing.converged or periods < 1.0 else None


def _find_drift(fit: NorthFit) -> Told:
    moved = abs(fit.drift.size_deg)
    return {"value": moved / max(fit.drift.sd_deg, 1e-12), "by": 3600 * moved}


def _find_scatter(fit: NorthFit) -> Told:
    """Of all that was read, what scatters most beside the stated noise."""
    read = {fit.method: fit.by[fit.method].excess} | {one.name: one.excess for one in fit.azimuths}
    name, excess = max(read.items(), key=lambda item: item[1])
    return {"value": excess, "name": name}


def _find_misfit(found: Aligned) -> Told:
    solution = found.solution
    if len(found.orientation) < 2 or not solution.p_value < RARE:
        return None
    more = figure(float(np.sqrt(solution.chi2 / solution.freedom)))
    return describe_misfit(
        f"the residuals are {more} times what the noise explains",
        find_explanations(solution, found.time, found.orientation),
        "check mirror, orientation numbers, axes of the reference, and the magnetometer's "
        "calibration",
    )


OF_GYRO = (
    Fact(
        "methods disagree",
        _compare_methods,
        Limit(check=4.0),  # standard errors
        "{one} and {other} differ by {by}″",
        "check that all were read on one circle, east increasing, and that amplitudes and times "
        "belong together",
    ),
    Fact(
        "short swing",
        _find_short_swing,
        "check",
        "the record holds {value} periods of the swing",
        "follow the gyro for two periods or more",
    ),
    Fact(
        "zero drifts",
        _find_drift,
        Limit(check=3.0),  # standard errors
        "the middle of the swing moves by {by}″ over the record, so north is known to half of that "
        "at best",
        "let the gyro warm up, keep it out of sun and wind, and follow it again",
    ),
    Fact(
        "readings scatter",
        _find_scatter,
        Limit(check=1.0),  # times the stated noise, which chance does not exceed
        "the readings of {name} scatter by {value} times the stated noise; the standard error was "
        "widened",
        "look for a misread circle or a zero that drifts, and read again",
    ),
    Fact(
        "no spread",
        lambda fit: None if np.isfinite(fit.by[fit.method].sd_deg) else {},
        "check",
        "the standard error of north is not determined",
        "read more turning points, or state reading_sd_arcsec or time_sd_s",
    ),
)
OF_SIGHTING = (
    Fact(
        "faces",
        lambda one: {"value": 2 * abs(one.collimation_arcsec), "name": one.name},
        Limit(check=120.0),  # arcseconds
        "the two faces to {name} differ by {value}″ and half a turn",
        "check the readings, and adjust the theodolite",
    ),
)
OF_PLATFORM = (
    Fact(
        "orientations",
        lambda found: {} if len(found.orientation) <= 1 else None,
        "refuse",
        "one orientation does not determine the rotation about the field",
        "turn the platform to at least two others",
    ),
    Fact("platform misfit", _find_misfit, "check", "{what}", "{action}"),
    Fact(
        "platform settles",
        lambda found: (
            float(np.linalg.norm(found.settled_by)) / ARCSEC_RAD if found.settled_by.any() else None
        ),
        "check",
        "the magnetometer turned by {value}″ while an orientation was recorded; circle and levels "
        "were read at one moment of it, and the standard error was enlarged by the same amount",
        "wait after each turn until the readings rest, and clamp the platform",
    ),
)


def _describe(fit: NorthFit) -> tuple[str, ...]:
    """How good it is."""
    said = [
        f"true north is at {fit.north_deg:.5f}° ± {figure(fit.sd_arcsec)}″ of the circle, by "
        f"{fit.method}"
    ]
    if not np.isfinite(fit.drift.sd_deg):
        said.append(
            "so few readings do not show whether the zero drifts: follow the gyro for eight "
            "turning points, or record its swing"
        )
    if fit.aligned is not None:
        said.append(
            f"standard error of the alignment: {figure(fit.aligned.worst_sd_arcsec)}″ about its "
            "worst axis"
        )
    return tuple(said)
