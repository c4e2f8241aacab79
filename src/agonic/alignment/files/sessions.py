"""Sessions as a description in TOML and the tables beside it: readers and writers of each kind."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from agonic.alignment.files.description import Description, read_description, write_description
from agonic.alignment.files.tables import (
    GON_DEG,
    list_star_columns,
    read_stars,
    read_table,
)
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
    Recorded,
    Session,
    Site,
    StarReadings,
    check_session,
    compute_unix_s,
    make_diagonal,
)
from agonic.arrays import Array
from agonic.atomic import make_folder
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Calibration
from agonic.calibration.chain import Chain
from agonic.calibration.steps import require_calibration
from agonic.errors import AgonicError
from agonic.exports.csv import write_csv, write_table
from agonic.files.calibration import load, save
from agonic.maths.earth.earth_rotation import TT_TAI_S, tai_utc_s
from agonic.maths.rotations.attitude import angles_deg, rot_nb
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
    >>> from agonic.alignment.files.sessions import write_session
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
    scale = description.head.time_scale
    errors = (part.across_sd_arcsec, part.about_sd_arcsec)
    stated = description.given["star"]
    star = read_stars(description.find(part.file), part.turns, errors=errors, **stated)
    description.add_source(part.file, len(star))
    star = replace(star, time=star.time - _ahead_s(star.time, scale))
    made = {**description.given, **_read_instruments(description), "star": star}
    for name in ("magnetometer", "reference"):
        ahead = float(_ahead_s(compute_unix_s(made[name])[:1], scale)[0])
        epoch = made[name].epoch - timedelta(seconds=ahead)
        made[name] = made[name].with_columns(epoch=epoch)
    made["magnetometer"] = _number_orientations(made["magnetometer"], star)
    made["remanence"] = description.read_samples("remanence")
    return check_session(Session(**made, sources=tuple(description.sources)))


def _read_instruments(description: Description) -> dict[str, Any]:
    """Magnetometer, reference and calibration, as far as a description has them."""
    read = {name: description.read_samples(name) for name in ("magnetometer", "reference")}
    part, known = description.parts["magnetometer"], None
    if part is not None and part.calibration:
        known = require_calibration(load(description.find(part.calibration)))
    return {**read, "calibration": known}


def _ahead_s(time: Array, scale: str) -> Array:
    """How far a time scale is ahead of UTC, s."""
    if scale == "UTC":
        return np.zeros_like(time)
    leap = tai_utc_s(time)
    leap = tai_utc_s(time - leap)
    return np.asarray(leap + {"TAI": 0.0, "GPS": GPS_TAI_S, "TT": TT_TAI_S}[scale])


def _number_orientations(samples: Samples, star: StarReadings) -> Samples:
    """With the numbers of the orientations, by the star sensor's times where the table has none.
    Readings while the platform was turned belong to none and are left out."""
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
    >>> from agonic.alignment.simulation.laboratory import simulate_north
    >>> from agonic.alignment.files.sessions import write_north
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
    >>> from agonic.alignment.files.sessions import write_coil
    >>> with TemporaryDirectory() as folder:
    ...     _ = write_coil(simulate_coil(reversals=4).session, folder)
    ...     read_coil(folder).geometric_axis.tolist()
    [0.0, 0.0, 1.0]
    """
    description = read_description(path, COIL)
    mistakes, made = description.mistakes, dict(description.given)
    attitude, missing = description.parts["attitude"], description.parts["site"] is None
    if attitude is not None:
        made["attitude"] = _make_attitude(attitude, made.get("site"), missing, mistakes)
    axis = made.get("geometric_axis")
    if axis is not None and not axis.any():
        mistakes.append("[coil] axis has no length")
    description.require()
    made |= _read_instruments(description)
    made["alignment"], before = _load_alignment(description)
    made["calibration"] = made["calibration"] or before
    return CoilSession(**made, sources=tuple(description.sources))


def _make_attitude(
    part: Any, site: Site | None, no_site: bool, mistakes: list[str]
) -> Attitude | None:
    """North-east-down into the platform's axes, by levels and azimuth or by the stars; None and
    what is wrong where angles are missing, or of both kinds."""
    levelled, stellar = (
        [name for name in names if getattr(part, name) is not None] for names in (LEVELLED, STELLAR)
    )
    if bool(levelled) == bool(stellar):
        wanted = f"{', '.join(LEVELLED)}, or {', '.join(STELLAR)}"
        mistakes.append(f"[attitude] needs {wanted}, one of the two")
        return None
    missing = sorted(set(LEVELLED if levelled else STELLAR) - {*levelled, *stellar})
    wrong = [f"[attitude] needs {', '.join(missing)} too"] if missing else []
    if stellar and no_site:
        wrong.append("[attitude] of a star sensor needs a [site]")
    unix = None
    if part.utc is not None:
        try:
            moment = datetime.fromisoformat(part.utc)
            unix = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
        except ValueError:
            example = "such as 2024-03-12T21:00:00Z"
            wrong.append(f"[attitude] utc {part.utc!r} is not a time {example}")
    mistakes.extend(wrong)
    if mistakes:
        return None
    if unix is None or site is None:
        # small errors: levels about the platform's own axes, the azimuth about down
        rotation = rot_nb(part.roll_deg, part.pitch_deg, part.heading_deg).T
        along = np.outer(rotation[:, 2], rotation[:, 2])
        level, turn = part.level_sd_arcsec**2, part.heading_sd_arcsec**2
        covariance = (level * (np.eye(3) - along) + turn * along) * ARCSEC_RAD**2
        return Attitude(rot_pn=rotation, covariance=covariance, frame="b")
    rot_ei = load_earth_rotation().rot_ei([unix])[0]
    star = rot_ci(part.ra_deg, part.dec_deg, part.rot_deg)
    return Attitude(
        rot_pn=star @ rot_ei.T @ rot_en(site.latitude_deg, site.longitude_deg),
        covariance=make_diagonal(part.across_sd_arcsec, part.about_sd_arcsec),
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


def write_session(session: Session, folder: Path | str) -> list[Path]:
    """Write a session's description and tables, and return their paths, session.toml last.

    Parameters: `session`; `folder`, made where it is not there. Raises `AgonicError` where a file
    cannot be written.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.alignment.simulation.session import simulate_session
    >>> with TemporaryDirectory() as folder:
    ...     files = write_session(simulate_session(orientations=4, readings=3).session, folder)
    ...     print(*(file.name for file in files))
    star.csv magnetometer.csv reference.csv session.toml
    """
    stars = {"star": list_star_columns(session.star)}
    return _write(session, folder, SESSION, stars, {"": {"time_scale": "UTC"}})


def write_north(session: NorthSession, folder: Path | str) -> list[Path]:
    """Write north.toml and its tables, as `read_north` reads them; return their paths.

    Parameters: `session`; `folder`, made where it is not there.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.alignment.simulation.laboratory import simulate_north
    >>> with TemporaryDirectory() as folder:
    ...     files = write_north(simulate_north(orientations=0).session, folder)
    ...     print(*(file.name for file in files))
    reversal.csv transit.csv swing.csv north.toml
    """
    turning = session.turning_deg
    tables = {} if turning is None else {"reversal": {"reading_deg": turning}}
    for name, (attribute, kind) in TABLES.items():
        if (part := getattr(session, attribute)) is not None:
            tables[name] = {key: getattr(part, key) for key in list_columns(kind)}
    sighted = [
        {"name": one.name, "readings_deg": one.reading_deg, "mirror": one.mirror}
        for one in session.sightings
    ]
    return _write(session, folder, NORTH, tables, {"sighting": sighted})


def write_coil(session: CoilSession, folder: Path | str) -> list[Path]:
    """Write coil.toml with its tables, as `read_coil` reads them; return their paths.

    Parameters: `session`; `folder`, made where it is not there. The attitude is written as roll,
    pitch and heading of the platform.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.alignment.simulation.laboratory import simulate_coil
    >>> with TemporaryDirectory() as folder:
    ...     files = write_coil(simulate_coil(reversals=4).session, folder)
    ...     print(*(file.name for file in files))
    magnetometer.csv reference.csv alignment.json coil.toml
    """
    stood = None if session.attitude is None else _describe_attitude(session.attitude)
    return _write(session, folder, COIL, {}, {"attitude": stood})


def _write(
    session: Recorded,
    folder: Path | str,
    name: str,
    tables: Mapping[str, Mapping[str, Any]],
    beside: Mapping[str, Any],
) -> list[Path]:
    """Write tables by the name of their section, readings, what is calibrated, the description."""
    home = make_folder(folder)
    files = {one: write_table(columns, home / f"{one}.csv") for one, columns in tables.items()}
    for one in ("magnetometer", "reference", "remanence"):
        if (samples := getattr(session, one, None)) is not None:
            files[one] = write_csv(samples, home / f"{one}.csv")
    if (turn := getattr(session, "alignment", None)) is not None:
        files["alignment"] = save(turn, home / "alignment.json")
    sections: dict[str, Any] = {one: {"file": file.name} for one, file in files.items()}
    if "reference" in sections:
        sections["reference"]["axes"] = "NED"
    written = [*files.values()]
    if session.calibration is not None:
        written.append(save(session.calibration, home / "calibration.json"))
        sections["magnetometer"]["calibration"] = written[-1].name
    return [*written, write_description(session, home, name, {**sections, **beside})]


def _describe_attitude(attitude: Attitude) -> dict[str, float]:
    if attitude.frame != "b":
        raise AgonicError("an attitude in a star sensor's axes is not written; give ra, dec, rot")
    roll, pitch, heading = (float(a) for a in angles_deg(attitude.rot_pn.T))
    down = attitude.rot_pn[:, 2]
    about = float(down @ attitude.covariance @ down)
    level = (float(np.trace(attitude.covariance)) - about) / 2
    return {
        "roll_deg": roll,
        "pitch_deg": pitch,
        "heading_deg": heading,
        "level_sd_arcsec": float(np.sqrt(max(level, 0.0))) / ARCSEC_RAD,
        "heading_sd_arcsec": float(np.sqrt(about)) / ARCSEC_RAD,
    }
