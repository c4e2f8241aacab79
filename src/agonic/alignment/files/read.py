"""`read_session`, `read_north`, `read_coil`: a description in TOML and the tables beside it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import MISSING, fields, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from agonic.alignment.files.description import Description, read_description
from agonic.alignment.files.tables import GON_DEG, read_stars, read_table, state_errors
from agonic.alignment.session.earth import load_earth_rotation
from agonic.alignment.session.laboratory import (
    Attitude,
    CoilSession,
    NorthSession,
    Platform,
    Sighting,
    SwingRecord,
    Transits,
)
from agonic.alignment.session.session import (
    Session,
    Site,
    StarReadings,
    check_session,
    compute_unix_s,
)
from agonic.arrays import Array
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration
from agonic.calibration.chain import Chain
from agonic.errors import AgonicError
from agonic.files.calibration import load
from agonic.maths.earth.earth_rotation import TT_TAI_S, tai_utc_s
from agonic.maths.rotations.attitude import rot_nb
from agonic.maths.rotations.frames import ARCSEC_RAD, rot_ci, rot_en
from agonic.samples import Samples

SESSION, NORTH, COIL = "session.toml", "north.toml", "coil.toml"
GPS_TAI_S = -19.0
LEVELLED = ("roll_deg", "pitch_deg", "heading_deg")
STELLAR = ("ra_deg", "dec_deg", "rot_deg", "utc")
TABLES: dict[str, tuple[str, Any]] = {
    "transit": ("transits", Transits),
    "swing": ("swing", SwingRecord),
    "platform": ("platform", Platform),
}
"""Tables of north.toml: the attribute of the session, and whose fields without a default are the
columns; angles of the circle in gon too."""


def read_session(path: Path | str) -> Session:
    """The session that a session.toml describes, with its tables.

    Parameters
    ----------
    path : the file, or the folder that it is in.

    Returns a `Session`, its times in UTC and its reference north-east-down. Raises `LogError` that
    names every mistake of the description at once, and `AgonicError` where tables do not belong
    together: times that do not meet, orientations without readings, units that cannot be.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.alignment.simulation.session import simulate_session
    >>> made = simulate_session(orientations=4, readings=3)
    >>> from agonic.alignment.files.write import write_session
    >>> with TemporaryDirectory() as folder:
    ...     _ = write_session(made.session, folder)
    ...     read_session(folder).orientations.tolist()
    [1, 2, 3, 4]
    """
    description = read_description(path, SESSION)
    part = description.parts["star"]
    if part is not None and (part.across_sd_arcsec is None) != (part.about_sd_arcsec is None):
        description.mistakes.append("[star] across_sd_arcsec and about_sd_arcsec go together")
    description.require()
    star, scale = _read_stars(description), description.head.time_scale
    made = {**description.given, **_read_instruments(description), "star": star}
    for name in ("magnetometer", "reference"):
        made[name] = _turn_into_utc(made[name], scale)
    made["magnetometer"] = _number_orientations(made["magnetometer"], star)
    made["remanence"] = description.read_samples("remanence")
    return check_session(Session(**made, sources=tuple(description.sources)))


def _read_instruments(description: Description) -> dict[str, Any]:
    """Magnetometer, reference and calibration, as far as a description has them."""
    read = {name: description.read_samples(name) for name in ("magnetometer", "reference")}
    return {**read, "calibration": description.load_calibration()}


def _read_stars(description: Description) -> StarReadings:
    """The star sensor's readings, in UTC."""
    part, scale = description.parts["star"], description.head.time_scale
    read = read_stars(description.find(part.file), part.turns)
    description.add_source(part.file, len(read))
    read = state_errors(read, part.across_sd_arcsec, part.about_sd_arcsec)
    time = read.time - _ahead_s(read.time, scale)
    return replace(read, time=time, **description.given["star"])


def _ahead_s(time: Array, scale: str) -> Array:
    """How far a time scale is ahead of UTC, s."""
    if scale == "UTC":
        return np.zeros_like(time)
    leap = tai_utc_s(time)
    leap = tai_utc_s(time - leap)
    return np.asarray(leap + {"TAI": 0.0, "GPS": GPS_TAI_S, "TT": TT_TAI_S}[scale])


def _turn_into_utc(samples: Samples, scale: str) -> Samples:
    """Samples whose epoch is in a time scale, in UTC."""
    ahead = float(_ahead_s(compute_unix_s(samples)[:1], scale)[0])
    assert samples.epoch is not None, "unix_of refuses samples without"
    return samples.with_columns(epoch=samples.epoch - timedelta(seconds=ahead))


def _number_orientations(samples: Samples, star: StarReadings) -> Samples:
    """With the numbers of the orientations, by the star sensor's times where the table has none.

    Readings while the platform was turned belong to none and are left out.
    """
    if samples.station is not None:
        wanted = np.isin(samples.station, star.orientation)
        if not wanted.any():
            raise AgonicError(
                "no orientation of the magnetometer's table is in the star sensor's; number them "
                "alike in both"
            )
        return samples if wanted.all() else samples.select(np.flatnonzero(wanted))
    time = compute_unix_s(samples)
    number = np.zeros(len(time))
    for orientation in np.unique(star.orientation):
        own = star.time[star.orientation == orientation]
        number[(time >= own.min() - 0.5) & (time <= own.max() + 0.5)] = orientation
    inside = np.flatnonzero(np.isin(number, star.orientation) & (number != 0))
    if not len(inside):
        raise AgonicError(
            "no reading of the magnetometer falls into an orientation of the star sensor; check "
            "dates, time zones and time_scale, or add a column orientation"
        )
    return samples.with_columns(station=number).select(inside)


def read_north(path: Path | str) -> NorthSession:
    """The session that a north.toml describes, with its tables.

    Parameters
    ----------
    path : the file, or the folder that it is in.

    Returns a `NorthSession`, angles in degrees. Raises `LogError` that names every mistake of the
    description at once, and `AgonicError` where its parts do not belong together.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.alignment.simulation.north import simulate_north
    >>> from agonic.alignment.files.write import write_north
    >>> with TemporaryDirectory() as folder:
    ...     _ = write_north(simulate_north(orientations=0).session, folder)
    ...     len(read_north(folder).turning_deg)
    8
    """
    description = read_description(path, NORTH)
    sightings = tuple(_read_sightings(description))
    description.require()
    parts, made = description.parts, dict(description.given)
    if parts["reversal"] is not None:
        read = _read_columns(description, parts["reversal"].file, ("reading_deg",))
        made["turning_deg"] = read["reading_deg"]
    for name, (attribute, kind) in TABLES.items():
        if parts[name] is not None:
            read = _read_columns(description, parts[name].file, list_columns(kind))
            made[attribute] = kind(**read, **made.get(attribute, {}))
    made |= _read_instruments(description)
    return NorthSession(**made, sightings=sightings, sources=tuple(description.sources))


def list_columns(kind: Any) -> tuple[str, ...]:
    """The columns of what is read from a table: its fields without a default."""
    return tuple(one.name for one in fields(kind) if one.default is MISSING)


def _read_sightings(description: Description) -> Iterator[Sighting]:
    """What was sighted; sightings without readings are noted as mistakes."""
    for number, part in enumerate(description.repeated["sighting"], start=1):
        degrees = part.readings_deg or [GON_DEG * value for value in part.readings_gon or []]
        if (part.readings_deg is None) == (part.readings_gon is None):
            what = "needs readings_deg or readings_gon"
        else:
            what = "" if degrees else "has no readings"
        if what:
            description.mistakes.append(f"[[sighting]] {number} {what}")
        else:
            yield Sighting(name=part.name, reading_deg=np.array(degrees), mirror=part.mirror)


def _read_columns(description: Description, file: str, names: tuple[str, ...]) -> dict[str, Array]:
    """The columns of a table by name, angles in degrees."""
    table = read_table(description.find(file), f"a CSV table of {', '.join(names)}")
    description.add_source(file, len(table))
    columns = table.read_angles(names)
    if "orientation" in columns:
        columns["orientation"] = columns["orientation"].astype(int)
    return columns


def read_coil(path: Path | str) -> CoilSession:
    """The session that a coil.toml describes, with its tables.

    Parameters
    ----------
    path : the file, or the folder that it is in.

    Returns a `CoilSession`. Raises `LogError` that names every mistake of the description at once,
    and `AgonicError` where its parts do not belong together.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.alignment.simulation.laboratory import simulate_coil
    >>> from agonic.alignment.files.write import write_coil
    >>> with TemporaryDirectory() as folder:
    ...     _ = write_coil(simulate_coil(reversals=4).session, folder)
    ...     read_coil(folder).geometric_axis.tolist()
    [0.0, 0.0, 1.0]
    """
    description = read_description(path, COIL)
    parts, mistakes = description.parts, description.mistakes
    if parts["attitude"] is not None:
        mistakes.extend(_list_attitude_mistakes(parts["attitude"], parts["site"] is not None))
    axis = description.given.get("geometric_axis")
    if axis is not None and not axis.any():
        mistakes.append("[coil] axis has no length")
    description.require()
    made = {**description.given, **_read_instruments(description)}
    made["alignment"], before = _load_alignment(description)
    made["calibration"] = made["calibration"] or before
    made["attitude"] = _make_attitude(parts["attitude"], made.get("site"))
    return CoilSession(**made, sources=tuple(description.sources))


def _list_attitude_mistakes(part: Any, site: bool) -> list[str]:
    """Angles that are missing, or of both kinds."""
    levelled = [name for name in LEVELLED if getattr(part, name) is not None]
    stellar = [name for name in STELLAR if getattr(part, name) is not None]
    wanted = f"{', '.join(LEVELLED)}, or {', '.join(STELLAR)}"
    if bool(levelled) == bool(stellar):
        return [f"[attitude] needs {wanted}, one of the two"]
    missing = sorted(set(LEVELLED if levelled else STELLAR) - {*levelled, *stellar})
    said = [f"[attitude] needs {', '.join(missing)} too"] if missing else []
    if stellar and not site:
        said.append("[attitude] of a star sensor needs a [site]")
    if part.utc is not None and _moment(part.utc) is None:
        said.append(f"[attitude] utc {part.utc!r} is not a time such as 2024-03-12T21:00:00Z")
    return said


def _moment(text: str) -> float | None:
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _make_attitude(part: Any, site: Site | None) -> Attitude | None:
    """North-east-down into the platform's axes: by levels and azimuth, or by the stars."""
    if part is None:
        return None
    if part.utc is None:
        level, turn = part.level_sd_arcsec, part.heading_sd_arcsec
        # small errors: levels about the platform's own axes, the azimuth about down
        rotation = rot_nb(part.roll_deg or 0.0, part.pitch_deg or 0.0, part.heading_deg or 0.0).T
        down = rotation[:, 2]
        flat = np.eye(3) - np.outer(down, down)
        covariance = (level**2 * flat + turn**2 * np.outer(down, down)) * ARCSEC_RAD**2
        return Attitude(rot_pn=rotation, covariance=covariance, frame="b")
    unix = _moment(part.utc)
    assert site is not None, "checked with the description"
    assert unix is not None, "checked with the description"
    rot_ei = load_earth_rotation().rot_ei([unix])[0]
    sd = np.array([part.across_sd_arcsec, part.across_sd_arcsec, part.about_sd_arcsec])
    star = rot_ci(part.ra_deg or 0.0, part.dec_deg or 0.0, part.rot_deg or 0.0)
    return Attitude(
        rot_pn=star @ rot_ei.T @ rot_en(site.latitude_deg, site.longitude_deg),
        covariance=np.diag(sd**2) * ARCSEC_RAD**2,
        frame="c",
    )


def _load_alignment(description: Description) -> tuple[Alignment | None, Calibration | None]:
    """The alignment, and what corrects the readings before it where both are one chain."""
    part = description.parts["alignment"]
    if part is None:
        return None, None
    file = description.find(part.file)
    found = load(file)
    description.add_source(part.file, 1)
    if isinstance(found, Alignment):
        return found, None
    if isinstance(found, Chain) and isinstance(found.steps[-1], Alignment):
        before = found.steps[:-1]
        return found.steps[-1], before[0] if len(before) == 1 else Chain(steps=before)
    raise AgonicError(f"{file} is a {found.kind}, no alignment; fit one, or leave [alignment] out")
