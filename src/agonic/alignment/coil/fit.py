"""`fit_coil`: the magnetic axis and the constant of a coil, from current reversals."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from agonic.alignment.coil.result import (
    EFFECTS,
    FACTS,
    MAX_DRIFT,
    SAME_CURRENT,
    CoilFit,
    Direction,
    Level,
    read_stretches,
)
from agonic.alignment.explanations import find_causes
from agonic.alignment.maths.columns import CoilEstimate, choose_drift, estimate_coil, fit_columns
from agonic.alignment.session.earth import load_earth_rotation
from agonic.alignment.session.laboratory import CoilSession
from agonic.alignment.session.session import compute_unix_s
from agonic.arrays import Array
from agonic.errors import ValidityError
from agonic.health import figure
from agonic.maths.rotations.angles import angle_deg
from agonic.maths.rotations.frames import ARCSEC_RAD, rot_en


def fit_coil(session: CoilSession) -> CoilFit:
    """The magnetic axis of a coil in every frame that is known, and its constant.

    With the current at +I and −I, (B₊ − B₋)/2I is the coil's vector k by the ampere: the ambient
    field and the magnetometer's bias cancel. The means of all stretches of constant current give

        y_j = k I_j + q I_j² + drift(t_j) + ambient_j,

    by least squares, so any order and sizes of the current serve. The ambient's changes are those
    of the reference, turned into the magnetometer's axes where alignment and attitude are known and
    fitted otherwise; what is left of drift is a polynomial as long as it pays.

    Parameters
    ----------
    session : readings with the current, and the chain to the frames wanted (`read_coil`).

    Returns a `CoilFit`. Raises `CoverageError` where the current changes too rarely.

    Source: patent CN 108871301 B.

    >>> from agonic.alignment.simulation.laboratory import simulate_coil
    >>> made = simulate_coil(seed=2)
    >>> fit = fit_coil(made.session)
    >>> fit.reversals, bool(fit.axis_sd_arcsec < 1.0)
    (100, True)
    """
    current, read, seen = read_stretches(session)
    level = _levels(current)
    even = int(level.max()) > 0
    drift = choose_drift(current, seen, MAX_DRIFT, even=even)
    found = estimate_coil(current, seen, drift, even=even)
    time = None
    if session.magnetometer.epoch is not None:  # the middle of the measurement
        time = float(compute_unix_s(session.magnetometer)[[0, -1]].mean())
    directions = _directions(session, found, time)
    away, away_sd = _geometry(session, directions)
    fit = CoilFit(
        session=session,
        current=current,
        read=read,
        stretches=seen,
        estimate=found,
        directions=directions,
        time=time,
        geometric_deg=away,
        geometric_sd_arcsec=away_sd,
    )
    if even:
        levels, p = _linearity(fit, level)
        fit = replace(fit, levels=levels, p_linear=p)
    return replace(fit, findings=find_causes(FACTS, EFFECTS, fit), remarks=_describe(fit))


def _levels(current: Array) -> NDArray[np.int64]:
    """The number of each stretch's size of current, from the smallest; −1 for none."""
    size = np.abs(current)
    order = np.argsort(size)
    number = np.empty(len(size), dtype=np.int64)
    step = np.diff(size[order], prepend=0.0) > SAME_CURRENT * float(size.max())
    number[order] = np.cumsum(step) - 1
    return number


def _directions(
    session: CoilSession, found: CoilEstimate, time: float | None
) -> dict[str, Direction]:
    """The axis in all frames to which the chain leads."""
    size = float(np.linalg.norm(found.linear))
    axis = found.linear / size
    across = np.eye(3) - np.outer(axis, axis)
    covariance = across @ np.diag(found.covariance[:, 0, 0]) @ across / size**2
    last = Direction(frame="m", axis=axis, covariance=covariance)
    known = {"m": last}
    alignment, attitude, site = session.alignment, session.attitude, session.site
    if alignment is not None:
        last = last.turn(alignment.frame_out, session.rot_pm, alignment.covariance)
        known[last.frame] = last
    if attitude is None:
        return known
    # the attitude's error stands in the platform's axes, before the turn into north-east-down
    tilted = last.turn(last.frame, np.eye(3), attitude.covariance)
    known["n"] = tilted.turn("n", attitude.rot_pn.T)
    if site is not None:
        known["e"] = known["n"].turn("e", rot_en(site.latitude_deg, site.longitude_deg))
        with suppress(ValidityError):  # where the Earth's rotation is not known
            if time is not None:
                known["i"] = known["e"].turn("i", load_earth_rotation().rot_ei([time])[0].T)
    return known


def _geometry(
    session: CoilSession, directions: dict[str, Direction]
) -> tuple[float | None, float | None]:
    """The angle to the axis as drawn, and its standard error."""
    if session.geometric_axis is None:
        return None, None
    drawn = session.geometric_axis / np.linalg.norm(session.geometric_axis)
    here = directions[session.geometric_frame]
    away = here.axis - drawn * (here.axis @ drawn)
    sd = here.sd_arcsec
    if float(np.linalg.norm(away)) > 2 * sd * ARCSEC_RAD:  # nearer, the angle has no direction
        # the angle grows as the axis moves away from the drawn one, square to the axis itself
        along = away - here.axis * (away @ here.axis)
        along = along / np.linalg.norm(along)
        sd = float(np.sqrt(along @ here.covariance @ along)) / ARCSEC_RAD
    return float(angle_deg(here.axis, drawn)), sd


def _linearity(fit: CoilFit, level: NDArray[np.int64]) -> tuple[tuple[Level, ...], float]:
    """The constant at each level, and how often by chance they differ so much."""
    scale = float(np.abs(fit.current).max())
    columns = (level[:, None] == np.arange(level.max() + 1)) * fit.current[:, None] / scale
    found = fit_columns(fit.stretches, columns, fit.estimate.drift)
    each = found.coefficients / scale
    sd = np.sqrt(np.diag(found.spread)[:, None] * found.variance) / scale
    along, error = each @ fit.axis, np.sqrt((sd**2) @ fit.axis**2)
    mean = float((along / error**2).sum() / (1 / error**2).sum())
    chi2 = float((((along - mean) / error) ** 2).sum())
    sizes = [float(np.abs(fit.current[level == k]).mean()) for k in range(len(along))]
    levels = tuple(
        Level(current_A=size, constant=float(a), sd=float(e), departure=float(a - mean))
        for size, a, e in zip(sizes, along, error, strict=True)
    )
    return levels, float(chdtrc(len(along) - 1, chi2))


def _describe(fit: CoilFit) -> tuple[str, ...]:
    """How good it is, in sentences."""
    said = (
        f"constant {figure(fit.constant, 7)} ± {figure(fit.constant_sd)} nT/A from "
        f"{fit.reversals} reversals",
        f"standard error of the axis: {figure(fit.axis_sd_arcsec)}″ in the magnetometer's axes",
    )
    if fit.geometric_deg is None or fit.geometric_sd_arcsec is None:
        return said
    away = f"{figure(3600 * fit.geometric_deg, 4)}″ ± {figure(fit.geometric_sd_arcsec)}″"
    return (*said, f"the axis is {away} from the nominal axis")
