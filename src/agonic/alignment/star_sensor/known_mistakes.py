"""The usual mistakes with frames, signs and clocks, each tried on a session that fits badly."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import erfa
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from agonic.alignment.explanations import AS_GOOD, EXPLAINED
from agonic.alignment.maths import two_frames as kernel
from agonic.alignment.maths.solution import Solution
from agonic.alignment.maths.two_frames import compute_rotation_vector
from agonic.alignment.session import Session, load_earth_rotation, observe
from agonic.alignment.session.observed import solve_session
from agonic.alignment.session.session import PRESENT, REMOVED, StarReadings
from agonic.arrays import Array, Index
from agonic.errors import AgonicError
from agonic.maths.earth.earth_rotation import TT_TAI_S, UNIX_JD, tai_utc_s
from agonic.maths.rotations.frames import angles_323_deg, r3, rot_ci
from agonic.maths.rotations.vectors import find_best_rotation
from agonic.units import DAY_S

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


Change = Callable[[Session], Session]
Angles = tuple[Array, Array, Array]


class Mistake(NamedTuple):
    """A mistake by name, what to do, and the change of the session that would undo it."""

    words: str
    move: str
    undo: Change


ANGLES: tuple[tuple[str, str, Callable[[Array, Array, Array], Angles]], ...] = (
    (
        "roll counted from north, not from south",
        "add 180° to rot_deg",
        lambda ra, dec, rot: (ra, dec, rot + 180),
    ),
    (
        "roll counted the other way round",
        "change the sign of rot_deg",
        lambda ra, dec, rot: (ra, dec, -rot),
    ),
    (
        "roll counted from north and the other way round",
        "give 180° − rot_deg",
        lambda ra, dec, rot: (ra, dec, 180 - rot),
    ),
    ("roll counted from east", "add 90° to rot_deg", lambda ra, dec, rot: (ra, dec, rot + 90)),
    ("roll counted from west", "take 90° from rot_deg", lambda ra, dec, rot: (ra, dec, rot - 90)),
    (
        "active elementary rotations for passive ones",
        "change the sign of all three angles",
        lambda ra, dec, rot: (-ra, 180 - dec, -rot),
    ),
    ("right ascension in hours", "multiply ra_deg by 15", lambda ra, dec, rot: (15 * ra, dec, rot)),
    (
        "polar distance for declination",
        "give 90° − dec_deg",
        lambda ra, dec, rot: (ra, 90 - dec, rot),
    ),
)
"""Mistakes with Ra, Dec and Rot, degrees: what should have been given."""
PLACES: tuple[tuple[str, str, Callable[[float, float], tuple[float, float]]], ...] = (
    (
        "longitude counted west",
        "change the sign of longitude_deg: east is positive",
        lambda north, east: (north, -east),
    ),
    (
        "latitude with the sign reversed",
        "change the sign of latitude_deg: north is positive",
        lambda north, east: (-north, east),
    ),
    (
        "latitude and longitude exchanged",
        "exchange latitude_deg and longitude_deg",
        lambda north, east: (east, north),
    ),
)
"""Mistakes with the site: latitude and longitude as they should be."""
AXES = (
    (
        "a reference whose third axis points up",
        "change the sign of its z, or state its axes",
        ((1, 0, 0), (0, 1, 0), (0, 0, -1)),
    ),
    (
        "a reference with axes east, north, up",
        'state axes = "ENU" for the reference',
        ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
    ),
)
"""Mistakes with the axes of the reference: the matrix into north, east, down."""


def list_mistakes(session: Session) -> Iterator[Mistake]:
    """All of them."""
    for words, move, angles in ANGLES:
        yield Mistake(words, move, partial(_change_attitudes, partial(_change_angles, angles)))
    for words, move, attitudes in (*_list_senses(), *_list_date_frames(session)):
        yield Mistake(words, move, partial(_change_attitudes, attitudes))
    for words, move, place in PLACES:
        north, east = place(session.site.latitude_deg, session.site.longitude_deg)
        yield Mistake(words, move, partial(_state, "site", latitude_deg=north, longitude_deg=east))
    for words, move, seconds in _list_clocks(session):
        yield Mistake(words, move, partial(_delay, seconds))
    for effect in ("refraction", "aberration"):  # taken out twice, or not at all
        present = getattr(session.star, effect) == PRESENT
        other = REMOVED if present else PRESENT
        words = "that the star sensor had removed already" if present else "left in by the sensor"
        stated: dict[str, Any] = {effect: other}
        undo = partial(_state, "star", **stated)
        yield Mistake(f"{effect} {words}", f'state {effect} = "{other}"', undo)
    for words, move, matrix in AXES:
        yield Mistake(words, move, partial(_turn_field, "reference", np.array(matrix)))
    for k, axis in enumerate("xyz"):
        mirror = np.diag(np.where(np.arange(3) == k, -1.0, 1.0))
        words = f"left-handed axes of the magnetometer, its {axis} reversed"
        undo = partial(_turn_field, "magnetometer", mirror)
        yield Mistake(words, f"change the sign of mag_{axis}", undo)
    yield Mistake(
        "the pier difference with the sign reversed",
        "give the field at the magnetometer less that at the reference",
        partial(_state, "pier", difference=-np.asarray(session.pier.difference)),
    )


def _state(part: str, session: Session, **stated: Any) -> Session:
    """The session with something else stated of its star sensor, site or pier."""
    return replace(session, **{part: replace(getattr(session, part), **stated)})


def _change_attitudes(change: Callable[[StarReadings], Array], session: Session) -> Session:
    return _state("star", session, rot_ci=change(session.star))


def _change_angles(change: Callable[[Array, Array, Array], Angles], star: StarReadings) -> Array:
    alpha, beta, gamma = angles_323_deg(star.rot_ci).T
    return rot_ci(*change(alpha, 90.0 - beta, gamma))


def _delay(seconds: float, session: Session) -> Session:
    """The Earth turned on by so many seconds."""
    return _state("star", session, time=session.star.time + seconds)


def _turn_field(instrument: str, matrix: Array, session: Session) -> Session:
    samples = getattr(session, instrument)
    turned = samples.with_columns(field=samples.field @ matrix.T)
    return replace(session, **{instrument: turned})


def _turn_attitudes(matrix: Array, star: StarReadings) -> Array:
    """Attitudes from other axes than inertial ones."""
    return np.asarray(star.rot_ci @ matrix)


def _reorder(star: StarReadings, conjugate: bool = False) -> Array:
    wxyz = np.roll(Rotation.from_matrix(star.rot_ci).as_quat(), 1, axis=1)  # what was given,
    turned = Rotation.from_quat(wxyz)  # whose first number was x in truth
    return np.asarray((turned.inv() if conjugate else turned).as_matrix())


def _list_senses() -> Iterator[tuple[str, str, Callable[[StarReadings], Array]]]:
    """Which way rotations turn, and how quaternions are written."""
    yield (
        "the conjugate quaternion (or transposed matrix)",
        'turn the sense round: turns = "ic" for "ci", or "ci" for "ic"',
        lambda star: np.swapaxes(star.rot_ci, 1, 2),
    )
    last = "quaternions with the scalar last, read as scalar first"
    yield last, "exchange the columns", _reorder
    move = "exchange the columns and turn the sense round"
    yield f"conjugate {last}", move, partial(_reorder, conjugate=True)


def _list_date_frames(
    session: Session,
) -> Iterator[tuple[str, str, Callable[[StarReadings], Array]]]:
    """Attitudes that are not in J2000, and sidereal time mixed up with the rotation angle."""
    move = "turn them into J2000 (GCRS)"
    tt = (session.star.time + tai_utc_s(session.star.time) + TT_TAI_S) / DAY_S
    intermediate = erfa.c2i06a(UNIX_JD, tt)
    for name, matrix in (
        ("true equator and equinox", erfa.pnm06a(UNIX_JD, tt)),
        ("mean equator and equinox", erfa.pmat06(UNIX_JD, tt)),
        ("celestial intermediate system", intermediate),
    ):
        words = f"attitudes in the {name} of date, not J2000"
        yield words, move, partial(_turn_attitudes, matrix)
    origins = erfa.gst06a(UNIX_JD, tt, UNIX_JD, tt) - erfa.era00(UNIX_JD, tt)
    for sign, words in (
        (1.0, "the Earth rotation angle used with an equinox matrix, for GAST"),
        (-1.0, "GAST used with a CIO matrix, for the Earth rotation angle"),
    ):
        about_pole = np.swapaxes(intermediate, 1, 2) @ r3(sign * origins) @ intermediate
        pair = "turn the attitudes into J2000 (GCRS) with one consistent pair"
        yield words, pair, partial(_turn_attitudes, about_pole)
    yield (
        "attitudes in Earth-fixed axes, not J2000",
        move,
        lambda star: star.rot_ci @ load_earth_rotation().rot_ei(star.time),
    )


def _list_clocks(session: Session) -> Iterator[tuple[str, str, float]]:
    """Clocks in another scale or zone: what must be added to the times, s."""
    leap = float(tai_utc_s(session.middle)[()])
    for scale, ahead in (("TAI", leap), ("GPS time", leap - 19.0), ("TT", leap + TT_TAI_S)):
        yield f"{scale} taken for UTC", f'state time_scale = "{scale.split()[0]}"', -ahead
        yield f"UTC taken for {scale}", 'state time_scale = "UTC"', ahead
    for days in (1, -1):
        yield "times one day off", "check the date", days * DAY_S
    for hours in (h for h in range(-14, 15) if h != 0):
        side = "late" if hours < 0 else "early"
        words = f"times {abs(hours)} h {side} (a local time taken for UTC)"
        yield words, "give times in UTC", 3600.0 * hours
