"""The usual mistakes with frames, signs and clocks, each tried on a session that fits badly."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import erfa
import numpy as np
from scipy.spatial.transform import Rotation

from agonic.alignment.explanations import AS_GOOD, EXPLAINED, Explanation
from agonic.alignment.maths.solution import ROUNDS, Solution
from agonic.alignment.maths.two_frames import compute_rotation_vector
from agonic.alignment.session.earth import load_earth_rotation
from agonic.alignment.session.observed import observe, solve_session
from agonic.alignment.session.session import PRESENT, REMOVED, Session, StarReadings
from agonic.arrays import Array
from agonic.errors import AgonicError
from agonic.maths.earth.earth_rotation import TT_TAI_S, UNIX_JD, tai_utc_s
from agonic.maths.rotations.frames import ARCSEC_RAD, angles_323_deg, r3, rot_ci
from agonic.units import DAY_S

TRIED = 8
"""How many are tried on the whole session, after one reading of every orientation told which."""

Change = Callable[[Session], Session]


class Mistake(NamedTuple):
    """A mistake by name, what to do, and the change of the session that would undo it."""

    words: str
    move: str
    undo: Change


def compute_misfit(session: Session, result: Solution) -> float:
    """χ² of the residuals and of the way from the nominal mounting, over the freedom."""
    turn, sd_deg = find_way_from_nominal(session, result), 1.0
    if session.mounting is not None:
        sd_deg = session.mounting.sd_deg
    away = float(turn @ turn / np.radians(sd_deg) ** 2)
    return (result.chi2 + away) / max(result.freedom, 1)


def find_way_from_nominal(session: Session, result: Solution) -> Array:
    """The rotation vector (3,) from the nominal mounting to the alignment; zero without one."""
    if session.mounting is None:
        return np.zeros(3)
    return compute_rotation_vector(result.unknowns.rot_mc @ session.mounting.rot_mc.T)


def find_likely_mistakes(session: Session, solve: Collection[str], now: float) -> list[Explanation]:
    """The mistakes that would explain the misfit, the best first; none where none does.

    All are tried on one reading of each orientation; the most promising on the whole session.
    """
    few = _select_first_readings(session)
    promising = sorted(_try_mistakes(few, solve, list(list_mistakes(few)), rounds=1))[:TRIED]
    every = list(list_mistakes(session))
    mistakes = [every[k] for _, k in promising]
    named = [
        Explanation(mistakes[k].words, mistakes[k].move, left, 0)
        for left, k in sorted(_try_mistakes(session, solve, mistakes))
    ]
    if not named or not named[0].left < EXPLAINED * now:
        return []
    return [one for one in named if one.left <= AS_GOOD * named[0].left]


def _try_mistakes(
    session: Session, solve: Collection[str], mistakes: Sequence[Mistake], rounds: int = ROUNDS
) -> Iterator[tuple[float, int]]:
    """What misfit is left with each mistake undone, and its number, where it can be undone."""
    for k, mistake in enumerate(mistakes):
        with suppress(AgonicError, ValueError, np.linalg.LinAlgError):
            changed = mistake.undo(session)
            found = solve_session(changed, observe(changed), solve, rounds)
            if np.isfinite(left := compute_misfit(changed, found)):
                yield left, k


def _select_first_readings(session: Session) -> Session:
    """The session with the first reading of each orientation only."""
    star, readings = session.star, session.magnetometer
    assert readings.station is not None, "checked when the session is"
    own, theirs = (np.unique(n, return_index=True)[1] for n in (star.orientation, readings.station))
    ten_arcsec = (10.0 * ARCSEC_RAD) ** 2 * np.eye(3)  # one reading does not tell its own noise
    return replace(
        session,
        star=replace(
            star.select(np.sort(own)), covariance=np.broadcast_to(ten_arcsec, (len(own), 3, 3))
        ),
        magnetometer=readings.select(np.sort(theirs)),
        noise=1.0,
        reference_noise=1.0,
    )


ANGLES = (
    ("roll counted from north, not from south", "add 180° to rot_deg", (1, 1, 1), (0, 0, 180)),
    ("roll counted the other way round", "change the sign of rot_deg", (1, 1, -1), (0, 0, 0)),
    (
        "roll counted from north and the other way round",
        "give 180° − rot_deg",
        (1, 1, -1),
        (0, 0, 180),
    ),
    ("roll counted from east", "add 90° to rot_deg", (1, 1, 1), (0, 0, 90)),
    ("roll counted from west", "take 90° from rot_deg", (1, 1, 1), (0, 0, -90)),
    (
        "active elementary rotations for passive ones",
        "change the sign of all three angles",
        (-1, -1, -1),
        (0, 180, 0),
    ),
    ("right ascension in hours", "multiply ra_deg by 15", (15, 1, 1), (0, 0, 0)),
    ("polar distance for declination", "give 90° − dec_deg", (1, -1, 1), (0, 90, 0)),
)
"""Mistakes with Ra, Dec and Rot: what each is multiplied by, and what is added then, degrees."""
PLACES = (
    (
        "longitude counted west",
        "change the sign of longitude_deg: east is positive",
        ((1, 0), (0, -1)),
    ),
    (
        "latitude with the sign reversed",
        "change the sign of latitude_deg: north is positive",
        ((-1, 0), (0, 1)),
    ),
    (
        "latitude and longitude exchanged",
        "exchange latitude_deg and longitude_deg",
        ((0, 1), (1, 0)),
    ),
)
"""Mistakes with the site: the matrix from what was given of latitude and longitude to both."""
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
    for words, move, sign, more in ANGLES:
        yield Mistake(words, move, partial(_change_attitudes, partial(_change_angles, sign, more)))
    for words, move, attitudes in (*_list_senses(), *_list_date_frames(session)):
        yield Mistake(words, move, partial(_change_attitudes, attitudes))
    for words, move, place in PLACES:
        north, east = np.array(place) @ [session.site.latitude_deg, session.site.longitude_deg]
        yield Mistake(words, move, partial(_state, "site", latitude_deg=north, longitude_deg=east))
    for words, move, seconds in _list_clocks(session):
        yield Mistake(words, move, partial(_state, "star", time=session.star.time + seconds))
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


def _change_angles(sign: Sequence[int], more: Sequence[int], star: StarReadings) -> Array:
    alpha, beta, gamma = angles_323_deg(star.rot_ci).T
    return rot_ci(*(np.array(sign) * np.stack([alpha, 90.0 - beta, gamma], axis=1) + more).T)


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
