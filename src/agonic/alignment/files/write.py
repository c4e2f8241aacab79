"""`write_session`, `write_north`, `write_coil`: a folder as its reader reads it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from agonic.alignment.files.description import write_description
from agonic.alignment.files.read import COIL, NORTH, SESSION, TABLES, list_columns
from agonic.alignment.files.tables import format_stars, format_table
from agonic.alignment.session.laboratory import Attitude, CoilSession, NorthSession
from agonic.alignment.session.session import Recorded, Session
from agonic.atomic import make_folder, write_atomically
from agonic.errors import AgonicError
from agonic.exports.csv import write_csv
from agonic.files.calibration import save
from agonic.maths.rotations.attitude import angles_deg
from agonic.maths.rotations.frames import ARCSEC_RAD


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
    stars = {"star": format_stars(session.star)}
    return _write(session, folder, SESSION, stars, {"": {"time_scale": "UTC"}})


def write_north(session: NorthSession, folder: Path | str) -> list[Path]:
    """Write north.toml and its tables, as `read_north` reads them; return their paths.

    Parameters: `session`; `folder`, made where it is not there.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.alignment.simulation.north import simulate_north
    >>> with TemporaryDirectory() as folder:
    ...     files = write_north(simulate_north(orientations=0).session, folder)
    ...     print(*(file.name for file in files))
    reversal.csv transit.csv swing.csv north.toml
    """
    turning = session.turning_deg
    tables = {} if turning is None else {"reversal": format_table({"reading_deg": turning})}
    for name, (attribute, kind) in TABLES.items():
        if (part := getattr(session, attribute)) is not None:
            tables[name] = format_table({key: getattr(part, key) for key in list_columns(kind)})
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
    tables: Mapping[str, str],
    beside: Mapping[str, Any],
) -> list[Path]:
    """Write tables by the name of their section, readings, what is calibrated, the description."""
    home = make_folder(folder)
    files = {one: write_atomically(home / f"{one}.csv", text) for one, text in tables.items()}
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
