"""The usual mistakes with frames, signs and clocks, each tried on a session that fits badly."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import erfa
import numpy as np
from scipy.spatial.transform import Rotation

from agonic.alignment.explanations import Explanation, choose_explanations
from agonic.alignment.maths.two_frames import MAX_ROUNDS, Solution, compute_rotation_vector
from agonic.alignment.session.earth import load_earth_rotation
from agonic.alignment.session.observed import observe, solve_session
from agonic.alignment.session.session import PRESENT, REMOVED, Session, StarReadings
from agonic.arrays import Array
from agonic.errors import AgonicError
from agonic.maths.earth.earth_rotation import TT_TAI_S, UNIX_JD, tai_utc_s
from agonic.maths.rotations.frames import angles_323_deg, r3, rot_ci
from agonic.units import DAY_S

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
_PLACES = (
    ("longitude counted west", "change the sign of longitude_deg: east is positive", 1, (1, -1)),
    (
        "latitude with the sign reversed",
        "change the sign of latitude_deg: north is positive",
        1,
        (-1, 1),
    ),
    ("latitude and longitude exchanged", "exchange latitude_deg and longitude_deg", -1, (1, 1)),
)
"""Mistakes with the site: the order in which latitude and longitude were given, their signs."""
_AXES = (
    (
        "a reference whose third axis points up",
        "change the sign of its z, or state its axes",
        (0, 1, 2),
    ),
    ("a reference with axes east, north, up", 'state axes = "ENU" for the reference', (1, 0, 2)),
)
"""Mistakes with the axes of the reference, which point up: their order in north, east, down."""


class Mistake(NamedTuple):
    """A mistake by name, what to do, and the session without it."""

    words: str
    move: str
    undone: Session


def compute_misfit(session: Session, result: Solution) -> float:
    """χ² of the residuals and of the way from the nominal mounting, over the freedom."""
    turn, mounting = find_way_from_nominal(session, result), session.mounting
    away = 0.0 if mounting is None else float(turn @ turn / np.radians(mounting.sd_deg) ** 2)
    return (result.chi2 + away) / max(result.freedom, 1)


def find_way_from_nominal(session: Session, result: Solution) -> Array:
    """The rotation vector (3,) from the nominal mounting to the alignment; zero without one."""
    if session.mounting is None:
        return np.zeros(3)
    return compute_rotation_vector(result.unknowns.rot_mc @ session.mounting.rot_mc.T)


def find_likely_mistakes(session: Session, solve: Collection[str], now: float) -> list[Explanation]:
    """The mistakes that would explain the misfit, the best first; none where none does. All are
    tried on one reading of each orientation; the most promising on the whole session."""
    few = dict(enumerate(list_mistakes(_select_first_readings(session))))
    # one reading does not show its own noise
    promising = [k for _, k in sorted(_try_mistakes(few, solve, 1, assumed_sd_arcsec=10.0))[:8]]
    every = {k: one for k, one in enumerate(list_mistakes(session)) if k in promising}
    tried = _try_mistakes(every, solve)
    return choose_explanations(
        (Explanation(every[k].words, every[k].move, left, 0) for left, k in tried), now
    )


def _try_mistakes(
    mistakes: Mapping[int, Mistake],
    solve: Collection[str],
    rounds: int = MAX_ROUNDS,
    assumed_sd_arcsec: float | None = None,
) -> Iterator[tuple[float, int]]:
    """What misfit is left with each mistake undone, and its number, where it can be undone."""
    for k, (_, _, session) in mistakes.items():
        with suppress(AgonicError, ValueError, np.linalg.LinAlgError):
            found = solve_session(session, observe(session, assumed_sd_arcsec), solve, rounds)
            if np.isfinite(left := compute_misfit(session, found)):
                yield left, k


def _select_first_readings(session: Session) -> Session:
    """The session with the first reading of each orientation only."""
    star, readings = session.star, session.magnetometer
    assert readings.station is not None, "checked when the session is"
    own, theirs = (np.unique(n, return_index=True)[1] for n in (star.orientation, readings.station))
    return replace(
        session,
        star=star.select(np.sort(own)),
        magnetometer=readings.select(np.sort(theirs)),
        noise=1.0,
        reference_noise=1.0,
    )


def list_mistakes(session: Session) -> Iterator[Mistake]:
    """All of them."""
    star, place = session.star, [session.site.latitude_deg, session.site.longitude_deg]
    for words, move, attitudes in (*_list_conventions(star), *_list_date_frames(star)):
        yield Mistake(words, move, _state(session, "star", rot_ci=attitudes))
    for words, move, order, sign in _PLACES:
        north, east = np.array(place[::order]) * sign
        with suppress(AgonicError):  # where there is no such place
            undone = _state(session, "site", latitude_deg=north, longitude_deg=east)
            yield Mistake(words, move, undone)
    for words, move, seconds in _list_clocks(session.middle):
        yield Mistake(words, move, _state(session, "star", time=star.time + seconds))
    for effect in ("refraction", "aberration"):  # taken out twice, or not at all
        present = getattr(star, effect) == PRESENT
        other = REMOVED if present else PRESENT
        words = "that the star sensor had removed already" if present else "left in by the sensor"
        undone = _state(session, "star", **{effect: other})
        yield Mistake(f"{effect} {words}", f'state {effect} = "{other}"', undone)
    for words, move, axes in _AXES:
        field = session.reference.field[:, axes] * [1.0, 1.0, -1.0]
        yield Mistake(words, move, _state(session, "reference", field=field))
    for k, axis in enumerate("xyz"):
        field = session.magnetometer.field * np.where(np.arange(3) == k, -1.0, 1.0)
        words = f"left-handed axes of the magnetometer, its {axis} reversed"
        undone = _state(session, "magnetometer", field=field)
        yield Mistake(words, f"change the sign of mag_{axis}", undone)
    yield Mistake(
        "the pier difference with the sign reversed",
        "give the field at the magnetometer less that at the reference",
        _state(session, "pier", difference=-np.asarray(session.pier.difference)),
    )


def _state(session: Session, part: str, **stated: Any) -> Session:
    """The session with something else stated of its star sensor, site, pier or readings."""
    return replace(session, **{part: replace(getattr(session, part), **stated)})


def _list_conventions(star: StarReadings) -> Iterator[tuple[str, str, Array]]:
    """How angles are counted, which way rotations turn, and how quaternions are written."""
    alpha, beta, gamma = angles_323_deg(star.rot_ci).T
    for words, move, sign, more in ANGLES:
        angles = np.array(sign) * np.stack([alpha, 90.0 - beta, gamma], axis=1) + more
        yield words, move, rot_ci(*angles.T)
    yield (
        "the conjugate quaternion (or transposed matrix)",
        'turn the sense round: turns = "ic" for "ci", or "ci" for "ic"',
        np.swapaxes(star.rot_ci, 1, 2),
    )
    # what was given as w, whose first number was x in truth
    wxyz = np.roll(Rotation.from_matrix(star.rot_ci).as_quat(), 1, axis=1)
    turned = Rotation.from_quat(wxyz)
    last = "quaternions with the scalar last, read as scalar first"
    yield last, "exchange the columns", turned.as_matrix()
    move = "exchange the columns and turn the sense round"
    yield f"conjugate {last}", move, turned.inv().as_matrix()


def _list_date_frames(star: StarReadings) -> Iterator[tuple[str, str, Array]]:
    """Attitudes that are not in J2000, and sidereal time mixed up with the rotation angle."""
    move = "turn them into J2000 (GCRS)"
    tt = (star.time + tai_utc_s(star.time) + TT_TAI_S) / DAY_S
    intermediate = erfa.c2i06a(UNIX_JD, tt)
    for name, matrix in (
        ("true equator and equinox", erfa.pnm06a(UNIX_JD, tt)),
        ("mean equator and equinox", erfa.pmat06(UNIX_JD, tt)),
        ("celestial intermediate system", intermediate),
    ):
        yield f"attitudes in the {name} of date, not J2000", move, star.rot_ci @ matrix
    origins = erfa.gst06a(UNIX_JD, tt, UNIX_JD, tt) - erfa.era00(UNIX_JD, tt)
    pair = "turn the attitudes into J2000 (GCRS) with one consistent pair"
    for sign, words in (
        (1.0, "the Earth rotation angle used with an equinox matrix, for GAST"),
        (-1.0, "GAST used with a CIO matrix, for the Earth rotation angle"),
    ):
        about_pole = np.swapaxes(intermediate, 1, 2) @ r3(sign * origins) @ intermediate
        yield words, pair, star.rot_ci @ about_pole
    with suppress(AgonicError):
        fixed = load_earth_rotation().rot_ei(star.time)
        yield "attitudes in Earth-fixed axes, not J2000", move, star.rot_ci @ fixed


def _list_clocks(middle: float) -> Iterator[tuple[str, str, float]]:
    """Clocks in another scale or zone: what must be added to the times, s."""
    leap = float(tai_utc_s(middle)[()])
    for scale, ahead in (("TAI", leap), ("GPS time", leap - 19.0), ("TT", leap + TT_TAI_S)):
        yield f"{scale} taken for UTC", f'state time_scale = "{scale.split()[0]}"', -ahead
        yield f"UTC taken for {scale}", 'state time_scale = "UTC"', ahead
    for days in (1, -1):
        yield "times one day off", "check the date", days * DAY_S
    for hours in (h for h in range(-14, 15) if h != 0):
        side = "late" if hours < 0 else "early"
        words = f"times {abs(hours)} h {side} (a local time taken for UTC)"
        yield words, "give times in UTC", 3600.0 * hours
