"""`fit_north`: true north by a gyrotheodolite, and what is pointed by it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from agonic.alignment.calibration import make_calibration, make_provenance
from agonic.alignment.maths import north as kernel
from agonic.alignment.maths.north import North, Swing
from agonic.alignment.maths.reversals import fit_reversals
from agonic.alignment.north.drift import NOT_TOLD, Drift, estimate_drift
from agonic.alignment.north.evidence import examine
from agonic.alignment.north.platform import Aligned, align_platform
from agonic.alignment.north.result import Azimuth, NorthFit
from agonic.alignment.session.north import NorthSession, Sighting
from agonic.calibration.alignment import Alignment
from agonic.calibration.chain import Chain

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
    return examine(whole)


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
        by["reversal"] = fit_reversals(session.turning_deg, sd)
    if session.transits is not None:
        by["transit"], constant, constant_sd = _transit(session)
    drift = _find_drift(swing, by)
    # north is where the zero was at some moment of the record, and nobody knows at which
    by = {
        name: one._replace(sd_deg=float(np.hypot(one.sd_deg, drift.allowed_deg / 2)))
        for name, one in by.items()
    }
    method = min(by, key=lambda name: (not np.isfinite(by[name].sd_deg), by[name].sd_deg))
    return NorthFit(
        session=session,
        by=by,
        method=method,
        swing=swing,
        drift=drift,
        constant=constant,
        constant_sd=constant_sd,
    )


def _find_drift(swing: Swing | None, by: Mapping[str, North]) -> Drift:
    """The drift of the gyro's zero as the record tells it, or else its turning points."""
    if swing is not None and swing.converged:
        return estimate_drift(swing.drift_deg, swing.drift_sd_deg)
    if "reversal" in by:
        return estimate_drift(by["reversal"].drift_deg, by["reversal"].drift_sd_deg)
    return NOT_TOLD


def _transit(session: NorthSession) -> tuple[North, float, float]:
    """By transits: a half-period is the difference of two times, Δt that of two half-periods."""
    transits = session.transits
    assert transits is not None, "asked for only with transits"
    amplitude = (transits.amplitude_east + transits.amplitude_west) / 2
    # t1, t2, t3 are stopped: Δt = (t2 − t1) − (t3 − t2), so its variance is (1 + 4 + 1) that of one
    one_sd = session.time_sd_s
    return kernel.fit_transits(
        transits.setting_deg,
        amplitude * (transits.east_s - transits.west_s),
        None if one_sd is None else amplitude * np.sqrt(6.0) * one_sd,
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
    magnetometer, reference = session.magnetometer, session.reference
    assert magnetometer is not None, "there is an alignment"
    assert reference is not None, "there is an alignment"
    settings = {"fit": "north", "method": method, "constant_arcsec": session.constant_arcsec}
    arrays = {one.name: one.field for one in (magnetometer, reference)}
    return make_calibration(
        found.rot_mb,
        found.covariance,
        magnetometer,
        make_provenance(session.sources, arrays, settings, *METHOD),
        frame="b",
        before=session.calibration,
    )
