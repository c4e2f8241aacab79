"""Which of the usual mistakes would explain a session that fits badly."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.alignment.explanations import AS_GOOD, EXPLAINED
from agonic.alignment.maths import two_frames as kernel
from agonic.alignment.maths.solution import Solution
from agonic.alignment.maths.two_frames import compute_rotation_vector
from agonic.alignment.session import Session, observe
from agonic.alignment.star_sensor.known_mistakes import Mistake, list_mistakes
from agonic.alignment.star_sensor.solve import solve_session
from agonic.arrays import Index
from agonic.errors import AgonicError
from agonic.maths.rotations.vectors import find_best_rotation

TRIED, FEW = 8, 1
"""How many are tried on the whole session, and on how many readings of an orientation first."""


def compute_misfit(session: Session, result: Solution) -> float:
    """χ² of the residuals and of the way from the nominal mounting, over the freedom."""
    away = 0.0
    if session.mounting is not None:
        turn = compute_rotation_vector(result.unknowns.rot_mc @ session.mounting.rot_mc.T)
        away = float(turn @ turn) / np.radians(session.mounting.sd_deg) ** 2
    return (result.chi2 + away) / max(result.freedom, 1)


def find_likely_mistakes(session: Session, solve: Collection[str], now: float) -> list[Mistake]:
    """The mistakes that would explain the misfit, the best first; none where none does.

    All are tried on a few readings of each orientation; the most promising on the whole session.
    """
    few = _few(session)
    promising = sorted(
        (
            (_promise(few, mistake, solve), k, mistake)
            for k, mistake in enumerate(list_mistakes(few))
        ),
        key=lambda one: one[:2],
    )
    order = [k for left, k, _ in promising[:TRIED] if np.isfinite(left)]
    whole = list(list_mistakes(session))
    tried = []
    for mistake in (whole[k] for k in order):
        try:
            changed = mistake.undo(session)
            left = compute_misfit(changed, solve_session(changed, observe(changed), solve))
        except (AgonicError, ValueError, np.linalg.LinAlgError):
            continue
        tried.append((left, mistake))
    best = min((left for left, _ in tried), default=np.inf)
    if not best < EXPLAINED * now:
        return []
    close = [(left, mistake) for left, mistake in tried if left <= AS_GOOD * best]
    return [mistake for _, mistake in sorted(close, key=lambda pair: pair[0])]


def _few(session: Session) -> Session:
    """The session with the first readings of each orientation only."""
    star, readings = session.star, session.magnetometer
    assert readings.station is not None, "checked when the session is"
    own, theirs = _first(star.orientation), _first(readings.station)
    few = star.select(own)
    return replace(
        session,
        star=replace(few, covariance=np.broadcast_to(np.eye(3), few.rot_ci.shape)),
        magnetometer=readings.select(theirs),
        noise=1.0,
        reference_noise=1.0,
    )


def _first(numbers: NDArray[Any]) -> Index:
    """The rows of the first readings of each orientation."""
    return np.sort(np.concatenate([np.flatnonzero(numbers == n)[:FEW] for n in np.unique(numbers)]))


def _promise(few: Session, mistake: Mistake, solve: Collection[str]) -> float:
    """What is left, nT rms, with the mistake undone, of the best rotation and way to nominal.

    Where bias or matrix are solved for, any linear map of the field stands for the rotation.
    """
    try:
        changed = mistake.undo(few)
        measured = observe(changed).measured
    except (AgonicError, ValueError, np.linalg.LinAlgError):
        return np.inf
    at = kernel.start_unknowns(changed.pier.difference)
    expected = kernel.predict_field_c(at, measured)
    turn = find_best_rotation(expected, measured.field)
    away = 0.0
    if changed.mounting is not None:
        vector = compute_rotation_vector(turn @ changed.mounting.rot_mc.T)
        beyond = np.linalg.norm(vector) - 4 * np.radians(changed.mounting.sd_deg)
        away = float(max(beyond, 0.0)) * float(np.linalg.norm(measured.reference[0]))
    if {"bias", "matrix"} & set(solve) and len(expected) > 6:
        design = np.column_stack([expected, np.ones(len(expected))])
        left = measured.field - design @ np.linalg.lstsq(design, measured.field, rcond=None)[0]
    else:
        left = measured.field - expected @ turn.T
    return float(np.sqrt((left**2).mean() + away**2))
