"""What does not fit together in a session, found before anything is computed."""

from __future__ import annotations

import numpy as np

from agonic.alignment.session.session import Session, compute_unix_s
from agonic.arrays import Array
from agonic.errors import AgonicError, LogError, UnitError
from agonic.units import RAW

OTHER_UNIT = 3.0
"""Ratio of the two magnitudes from which one of the units must be wrong."""
NOT_UNIT = 1e-3
"""How far an attitude may be from a rotation."""


def check_session(session: Session) -> Session:
    """The session, or an error that says what does not fit together and what to do.

    Raises `AgonicError` for times that do not meet, orientations without readings, attitudes that
    are no rotations and covariances that are none; `UnitError` for magnitudes that cannot be those
    of one place.
    """
    _check_attitudes(session)
    _check_covariance(session)
    _check_orientations(session)
    _check_times(session)
    _check_magnitudes(session)
    return session


def _check_attitudes(session: Session) -> None:
    matrices = session.star.rot_ci
    if len(matrices) == 0:
        raise LogError(f"{session.star.name} has no readings")
    off = np.abs(matrices @ np.swapaxes(matrices, 1, 2) - np.eye(3)).max(axis=(1, 2))
    if off.max() > NOT_UNIT or np.linalg.det(matrices).min() < 0:
        raise AgonicError(
            f"attitude {int(off.argmax()) + 1} of {session.star.name} is no rotation; give "
            "ra, dec, rot in degrees or unit quaternions"
        )


def _check_covariance(session: Session) -> None:
    covariance = session.star.covariance
    for what, value in (("noise", session.noise), ("reference noise", session.reference_noise)):
        if value is not None and not value > 0:
            raise AgonicError(f"the {what} is {value:g} nT; it must be above 0")
    if covariance is None:
        return
    least = np.linalg.eigvalsh(covariance)[:, 0]
    if not (np.isfinite(covariance).all() and least.min() > 0):
        raise AgonicError(
            f"the covariance of attitude {int(least.argmin()) + 1} of {session.star.name} is none: "
            "standard deviations must be above 0 and correlations below 1"
        )


def _check_orientations(session: Session) -> None:
    station = session.magnetometer.station
    if station is None:
        raise AgonicError(
            "the magnetometer's readings say no orientation; add a column orientation"
        )
    without = sorted(set(session.orientations.tolist()) - set(station.astype(int).tolist()))
    if without:
        shown = ", ".join(map(str, without[:8]))
        raise AgonicError(
            f"orientation {shown} has star readings but none of the magnetometer; check the "
            "numbers of the orientations in both tables"
        )


def _check_times(session: Session) -> None:
    """The three instruments must have read at the same time."""
    star = session.star.time
    for samples, what in ((session.magnetometer, "magnetometer"), (session.reference, "reference")):
        time = compute_unix_s(samples)
        if what == "reference" and len(time) > 1:
            _check_cover(compute_unix_s(session.magnetometer), time)
        gap = max(float(time.min() - star.max()), float(star.min() - time.max()))
        if gap > 0:
            raise AgonicError(
                f"the {what} and the star sensor never read at the same time: they are "
                f"{_duration(gap)} apart; check dates, time zones and time_scale"
            )


def _check_cover(time: Array, reference: Array) -> None:
    """The reference must go on while the magnetometer reads."""
    step = float(np.median(np.diff(reference)))
    short = max(reference[0] - time.min(), time.max() - reference[-1])
    if short > max(2 * step, 1.0):
        raise AgonicError(
            f"the reference does not cover the magnetometer's readings: {_duration(short)} are "
            "missing; check the time scales, or leave those orientations out"
        )


def _check_magnitudes(session: Session) -> None:
    if session.magnetometer.unit == RAW or session.reference.unit == RAW:
        raise UnitError("a session needs fields in nT; name the unit of magnetometer and reference")
    ours = float(np.median(np.linalg.norm(session.corrected, axis=1)))
    theirs = float(np.median(np.linalg.norm(session.reference.field, axis=1)))
    if not 1 / OTHER_UNIT < ours / max(theirs, 1e-9) < OTHER_UNIT:
        raise UnitError(
            f"the magnetometer reads {ours:.0f} nT and the reference {theirs:.0f} nT: one of the "
            "units is wrong"
        )


def _duration(seconds: float) -> str:
    """A length of time in words."""
    if seconds >= 86_400:
        return f"{seconds / 86_400:.1f} days"
    return f"{seconds / 3600:.2f} h" if seconds >= 3600 else f"{seconds:.1f} s"
