"""The usual mistakes with frames, signs and clocks, each tried on a session that fits badly."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import erfa
import numpy as np
from scipy.spatial.transform import Rotation

from agonic.alignment.session import Session, load_earth_rotation
from agonic.alignment.session.session import PRESENT, REMOVED, StarReadings
from agonic.arrays import Array
from agonic.maths.earth.earth_rotation import TT_TAI_S, UNIX_JD, tai_utc_s
from agonic.maths.rotations.frames import angles_323_deg, r2, r3, rot_ci
from agonic.units import DAY_S

Change = Callable[[Session], Session]


class Mistake(NamedTuple):
    """A mistake by name, what to do, and the change of the session that would undo it."""

    words: str
    move: str
    undo: Change


def list_mistakes(session: Session) -> Iterator[Mistake]:
    """All of them."""
    yield from _of_roll()
    yield from _of_sense()
    yield from _of_date_frames(session)
    yield from _of_site()
    yield from _of_time(session)
    yield from _of_effects(session)
    yield from _of_fields()


def _attitude(words: str, move: str, change: Callable[[StarReadings], Array]) -> Mistake:
    """A mistake that other attitudes would undo."""
    return Mistake(words, move, lambda s: replace(s, star=replace(s.star, rot_ci=change(s.star))))


def _celestial(star: StarReadings) -> tuple[Array, Array, Array]:
    """Ra, Dec and Rot, degrees."""
    alpha, beta, gamma = angles_323_deg(star.rot_ci).T
    return alpha, 90.0 - beta, gamma


def _of_roll() -> Iterator[Mistake]:
    """How Rot is counted."""
    for words, move, change in (
        ("roll counted from north, not from south", "add 180° to rot_deg", lambda r: r + 180),
        ("roll counted the other way round", "change the sign of rot_deg", lambda r: -r),
        (
            "roll counted from north and the other way round",
            "give 180° − rot_deg",
            lambda r: 180 - r,
        ),
        ("roll counted from east", "add 90° to rot_deg", lambda r: r + 90),
        ("roll counted from west", "take 90° from rot_deg", lambda r: r - 90),
    ):

        def undone(star: StarReadings, change: Callable[[Array], Array] = change) -> Array:
            ra, dec, rot = _celestial(star)
            return rot_ci(ra, dec, change(rot))

        yield _attitude(words, move, undone)


def _of_sense() -> Iterator[Mistake]:
    """Which way rotations turn, and how quaternions are written."""

    def active(star: StarReadings) -> Array:
        ra, dec, rot = _celestial(star)
        return r3(-np.radians(rot)) @ r2(np.radians(dec - 90.0)) @ r3(-np.radians(ra))

    def reordered(star: StarReadings, conjugate: bool = False) -> Array:
        xyzw = Rotation.from_matrix(star.rot_ci).as_quat()
        wxyz = np.roll(xyzw, 1, axis=1)  # what was given; its first number was x in truth
        turned = Rotation.from_quat(wxyz)
        return np.asarray((turned.inv() if conjugate else turned).as_matrix())

    def hours(star: StarReadings) -> Array:
        ra, dec, rot = _celestial(star)
        return rot_ci(15.0 * ra, dec, rot)

    def polar(star: StarReadings) -> Array:
        ra, dec, rot = _celestial(star)
        return rot_ci(ra, 90.0 - dec, rot)

    yield _attitude(
        "active elementary rotations for passive ones",
        "change the sign of all three angles",
        active,
    )
    yield _attitude(
        "the conjugate quaternion (or transposed matrix)",
        'turn the sense round: turns = "ic" for "ci", or "ci" for "ic"',
        lambda star: np.swapaxes(star.rot_ci, 1, 2),
    )
    yield _attitude(
        "quaternions with the scalar last, read as scalar first", "exchange the columns", reordered
    )
    yield _attitude(
        "conjugate quaternions with the scalar last, read as scalar first",
        "exchange the columns and turn the sense round",
        lambda star: reordered(star, True),
    )
    yield _attitude("right ascension in hours", "multiply ra_deg by 15", hours)
    yield _attitude("polar distance for declination", "give 90° − dec_deg", polar)


def _of_date_frames(session: Session) -> Iterator[Mistake]:
    """Attitudes that are not in J2000, and sidereal time mixed up with the rotation angle."""
    star = session.star
    tt = (star.time + tai_utc_s(star.time) + TT_TAI_S) / DAY_S
    of_date = {
        "the true equator and equinox of date": erfa.pnm06a(UNIX_JD, tt),
        "the mean equator and equinox of date": erfa.pmat06(UNIX_JD, tt),
        "the celestial intermediate system of date": erfa.c2i06a(UNIX_JD, tt),
    }
    for name, matrix in of_date.items():
        yield _attitude(
            f"attitudes in {name}, not J2000",
            "turn them into J2000 (GCRS)",
            partial(_turn_attitudes, matrix),
        )
    origins = erfa.gst06a(UNIX_JD, tt, UNIX_JD, tt) - erfa.era00(UNIX_JD, tt)
    for sign, words in (
        (1.0, "the Earth rotation angle used with an equinox matrix, for GAST"),
        (-1.0, "GAST used with a CIO matrix, for the Earth rotation angle"),
    ):
        turn = r3(sign * origins)
        about = _about_pole(of_date["the celestial intermediate system of date"], turn)
        yield _attitude(
            words,
            "turn the attitudes into J2000 (GCRS) with one consistent pair",
            partial(_turn_attitudes, about),
        )
    yield _attitude(
        "attitudes in Earth-fixed axes, not J2000",
        "turn them into J2000 (GCRS)",
        lambda s: s.rot_ci @ load_earth_rotation().rot_ei(s.time),
    )


def _turn_attitudes(matrix: Array, star: StarReadings) -> Array:
    """Attitudes from other axes than inertial ones."""
    return np.asarray(star.rot_ci @ matrix)


def _about_pole(rot_di: Array, turn: Array) -> Array:
    """A turn about the pole of date, in inertial axes."""
    return np.asarray(np.swapaxes(rot_di, 1, 2) @ turn @ rot_di)


def _of_site() -> Iterator[Mistake]:
    """Signs and order of the coordinates."""

    def moved(latitude: Callable[[float, float], tuple[float, float]]) -> Change:
        def change(session: Session) -> Session:
            site = session.site
            north, east = latitude(site.latitude_deg, site.longitude_deg)
            return replace(session, site=replace(site, latitude_deg=north, longitude_deg=east))

        return change

    yield Mistake(
        "longitude counted west",
        "change the sign of longitude_deg: east is positive",
        moved(lambda north, east: (north, -east)),
    )
    yield Mistake(
        "latitude with the sign reversed",
        "change the sign of latitude_deg: north is positive",
        moved(lambda north, east: (-north, east)),
    )
    yield Mistake(
        "latitude and longitude exchanged",
        "exchange latitude_deg and longitude_deg",
        moved(lambda north, east: (east, north)),
    )


def _of_time(session: Session) -> Iterator[Mistake]:
    """Clocks in another scale or zone: what must be added to the times, s."""
    leap = float(tai_utc_s(session.middle)[()])
    scales = [
        ("TAI taken for UTC", 'state time_scale = "TAI"', -leap),
        ("UTC taken for TAI", 'state time_scale = "UTC"', leap),
        ("GPS time taken for UTC", 'state time_scale = "GPS"', 19.0 - leap),
        ("UTC taken for GPS time", 'state time_scale = "UTC"', leap - 19.0),
        ("TT taken for UTC", 'state time_scale = "TT"', -leap - TT_TAI_S),
        ("UTC taken for TT", 'state time_scale = "UTC"', leap + TT_TAI_S),
        ("times one day off", "check the date", DAY_S),
        ("times one day off", "check the date", -DAY_S),
    ]
    for hours in [h for h in range(-14, 15) if h != 0]:
        scales.append(
            (
                f"times {abs(hours)} h {'late' if hours < 0 else 'early'} (a local time taken "
                f"for UTC)",
                "give times in UTC",
                3600.0 * hours,
            )
        )
    for words, move, seconds in scales:
        yield Mistake(
            words,
            move,
            partial(_later, seconds),
        )


def _later(seconds: float, session: Session) -> Session:
    """The Earth turned on by so many seconds."""
    return replace(session, star=replace(session.star, time=session.star.time + seconds))


def _of_effects(session: Session) -> Iterator[Mistake]:
    """Refraction and aberration taken out twice, or not at all."""
    for effect in ("refraction", "aberration"):
        present = getattr(session.star, effect) == PRESENT
        other = REMOVED if present else PRESENT
        words = "that the star sensor had removed already" if present else "left in by the sensor"
        yield Mistake(
            f"{effect} {words}",
            f'state {effect} = "{other}"',
            partial(_state_effect, effect, other),
        )


def _state_effect(effect: str, as_: str, session: Session) -> Session:
    changed = {effect: as_}
    return replace(session, star=replace(session.star, **changed))  # type: ignore[arg-type]


def _reverse(sign: Array, session: Session) -> Session:
    field = session.magnetometer.field * sign
    return replace(session, magnetometer=session.magnetometer.with_columns(field=field))


def _of_fields() -> Iterator[Mistake]:
    """Axes of the reference and the magnetometer, and the sign of the pier difference."""

    def reference(matrix: Array) -> Change:
        return lambda s: replace(
            s, reference=s.reference.with_columns(field=s.reference.field @ matrix.T)
        )

    yield Mistake(
        "a reference whose third axis points up",
        "change the sign of its z, or state its axes",
        reference(np.diag([1.0, 1.0, -1.0])),
    )
    yield Mistake(
        "a reference with axes east, north, up",
        'state axes = "ENU" for the reference',
        reference(np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])),
    )
    for k, axis in enumerate("xyz"):
        sign = np.where(np.arange(3) == k, -1.0, 1.0)
        yield Mistake(
            f"left-handed axes of the magnetometer, its {axis} reversed",
            f"change the sign of mag_{axis}",
            partial(_reverse, sign),
        )
    yield Mistake(
        "the pier difference with the sign reversed",
        "give the field at the magnetometer less that at the reference",
        lambda s: replace(s, pier=replace(s.pier, difference=-np.asarray(s.pier.difference))),
    )
