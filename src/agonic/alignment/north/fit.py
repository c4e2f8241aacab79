"""`fit_north`: true north by a gyrotheodolite, and what is pointed by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.alignment.maths import north as kernel
from agonic.alignment.maths.north import North, Swing
from agonic.alignment.north.platform import RARE, Aligned, align_platform
from agonic.alignment.north.result import Azimuth, NorthFit
from agonic.alignment.session.north import NorthSession, Sighting
from agonic.calibration.alignment import Alignment
from agonic.calibration.chain import Chain
from agonic.health import Finding, figure
from agonic.maths.rotations.angles import wrap_deg
from agonic.maths.rotations.frames import ARCSEC_RAD
from agonic.provenance import Input, Provenance

METHOD = ("harbin-2018",)
APART = 4.0
"""Two methods that differ by more standard errors do not agree."""
FEW_PERIODS = 1.0
DRIFTS = 3.0
"""Standard errors by which a drift of the zero stands out."""
BAD_FACES_ARCSEC = 60.0


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

    >>> from agonic.alignment.simulation.north import simulate_north
    >>> made = simulate_north(seed=1)
    >>> fit = fit_north(made.session)
    >>> fit.method, bool(abs(fit.north_deg - made.north_deg) * 3600 < 4 * fit.sd_arcsec)
    ('swing', True)
    """
    fit = _found(session)
    azimuths = tuple(_azimuth(fit, sighting) for sighting in session.sightings)
    found = None
    if session.platform is not None:
        found = align_platform(session, fit.north_deg, fit.sd_arcsec)
    whole = replace(
        fit,
        azimuths=azimuths,
        aligned=found,
        calibration=None if found is None else _calibration(session, found, fit.method),
    )
    judged = replace(whole, findings=tuple(_findings(whole)))
    return judged if judged.verdict == "refused" else replace(judged, remarks=_remarks(whole))


def _found(session: NorthSession) -> NorthFit:
    """North by every method that there are readings for."""
    by: dict[str, North] = {}
    sd = None if session.reading_sd_arcsec is None else session.reading_sd_arcsec / 3600.0
    swing, constant, constant_sd = None, None, None
    if session.swing is not None:
        swing = kernel.fit_swing(session.swing.time_s, session.swing.reading_deg, sd)
        freedom = len(swing.residuals) - len(swing.params)
        by["swing"] = North(
            float(swing.params[0]), float(np.sqrt(swing.covariance[0, 0])), freedom, swing.excess
        )
    if session.turning_deg is not None:
        by["reversal"] = kernel.fit_reversals(session.turning_deg, sd)
    if session.transits is not None:
        by["transit"], constant, constant_sd = _transit(session)
    if swing is not None and _drifts(swing):
        # north is where the zero was at some moment of the record, and nobody knows at which
        by = {
            name: one._replace(sd_deg=float(np.hypot(one.sd_deg, swing.drift_deg / 2)))
            for name, one in by.items()
        }
    method = min(by, key=lambda name: (not np.isfinite(by[name].sd_deg), by[name].sd_deg))
    return NorthFit(
        session=session,
        by=by,
        method=method,
        swing=swing,
        constant=constant,
        constant_sd=constant_sd,
    )


def _drifts(swing: Swing) -> bool:
    """Whether the zero of the gyro moves by more than chance."""
    return swing.converged and abs(swing.drift_deg) > DRIFTS * swing.drift_sd_deg


def _transit(session: NorthSession) -> tuple[North, float, float]:
    """By transits: a half-period is the difference of two times, Δt that of two half-periods."""
    transits = session.transits
    assert transits is not None, "asked for only with transits"
    product = kernel.multiply_transits(
        transits.amplitude_east, transits.amplitude_west, transits.east_s - transits.west_s
    )
    amplitude = (transits.amplitude_east + transits.amplitude_west) / 2
    # t1, t2, t3 are stopped: Δt = (t2 − t1) − (t3 − t2), so its variance is (1 + 4 + 1) that of one
    each = np.nan if session.time_sd_s is None else np.sqrt(6.0) * session.time_sd_s
    return kernel.fit_transits(
        transits.setting_deg,
        product,
        amplitude * each,
        session.transit_constant,
        session.transit_constant_sd,
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


def _calibration(session: NorthSession, found: Aligned, method: str) -> Alignment | Chain:
    """field_b = rotation.apply(field_m), after the magnetometer's own calibration."""
    back = found.rot_mb.T
    magnetometer, reference = session.magnetometer, session.reference
    assert magnetometer is not None, "there is an alignment"
    assert reference is not None, "there is an alignment"
    provenance = Provenance(
        inputs=session.sources
        or (
            Input.of_array(magnetometer.name, magnetometer.field),
            Input.of_array(reference.name, reference.field),
        ),
        settings={"fit": "north", "method": method, "constant_arcsec": session.constant_arcsec},
        method=METHOD,
    )
    turn = Alignment(
        rotation=Rotation.from_matrix(back),
        covariance=back @ found.covariance @ back.T,
        frame_in="m",
        frame_out="b",
        sensor=magnetometer.name,
        provenance=provenance,
    )
    if session.calibration is None:
        return turn
    known = session.calibration
    steps = known.steps if isinstance(known, Chain) else (known,)
    return Chain(steps=(*steps, turn), provenance=provenance)


def _findings(fit: NorthFit) -> list[Finding]:
    """What is wrong or worth knowing."""
    said = [*_disagreement(fit), *_swing(fit), *_drift(fit), *_scatter(fit)]
    if not np.isfinite(fit.by[fit.method].sd_deg):
        said.append(
            Finding(
                "no spread",
                "check",
                "nothing tells how well north is known",
                "read more turning points, or state reading_sd_arcsec or time_sd_s",
            )
        )
    for azimuth in fit.azimuths:
        if abs(azimuth.collimation_arcsec) > BAD_FACES_ARCSEC:
            said.append(
                Finding(
                    "faces",
                    "check",
                    f"the two faces to {azimuth.name} differ by "
                    f"{figure(2 * abs(azimuth.collimation_arcsec))}″ and half a turn",
                    "check the readings, and adjust the theodolite",
                )
            )
    found = fit.aligned
    if found is not None and len(found.orientation) < 2:
        said.append(
            Finding(
                "orientations",
                "refuse",
                "one orientation leaves the turn about the field open",
                "turn the platform to at least two others",
            )
        )
    elif found is not None and found.p_value < RARE:
        said.append(
            Finding(
                "platform misfit",
                "check",
                "the residuals are "
                f"{figure(float(np.sqrt(found.chi2 / found.freedom)))} times what the noise "
                "explains",
                "check mirror, orientation numbers, axes of the reference, and "
                "the magnetometer's calibration",
            )
        )
    return [*said, *_settling(found)]


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
    if fit.swing is None or not _drifts(fit.swing):
        return []
    return [
        Finding(
            "zero drifts",
            "check",
            f"the middle of the swing moves by {figure(3600 * abs(fit.swing.drift_deg))}″ over the "
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
    if fit.aligned is not None:
        said.append(
            f"standard error of the alignment: {figure(fit.aligned.worst_sd_arcsec)}″ about its "
            "worst axis"
        )
    return tuple(said)
