"""`write_north`: a folder with north.toml and its tables, as `read_north` reads them."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from agonic.alignment.files.north_schema import GyroSection
from agonic.alignment.files.read_north import FILE_NAME, TABLES
from agonic.alignment.files.write_description import (
    magnetometer_keys,
    pier_keys,
    write_instruments,
    write_toml,
)
from agonic.alignment.session.north import NorthSession
from agonic.atomic import make_folder, write_atomically


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
    home = make_folder(folder)
    transits, swing, platform = session.transits, session.swing, session.platform
    tables: dict[str, dict[str, ArrayLike]] = {}
    if session.turning_deg is not None:
        tables["reversal"] = {"reading_deg": session.turning_deg}
    if transits is not None:
        tables["transit"] = {name: getattr(transits, name) for name in TABLES["transit"]}
    if swing is not None:
        tables["swing"] = {name: getattr(swing, name) for name in TABLES["swing"]}
    if platform is not None:
        tables["platform"] = {name: getattr(platform, name) for name in TABLES["platform"]}
    files = [
        write_atomically(home / f"{name}.csv", format_table(columns))
        for name, columns in tables.items()
    ]
    files += write_instruments(session, home)
    return [*files, write_toml(home / FILE_NAME, _parts(session))]


def format_table(columns: Mapping[str, ArrayLike]) -> str:
    """A table as CSV, numbers to their last digit."""
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(np.asarray(c).tolist() for c in columns.values()), strict=True))
    return stream.getvalue()


def _parts(session: NorthSession) -> list[tuple[str, dict[str, Any] | None]]:
    """The sections of north.toml."""
    gyro = {name: getattr(session, name) for name in GyroSection.__struct_fields__}
    given = {"reversal": session.turning_deg, "transit": session.transits, "swing": session.swing}
    parts: list[tuple[str, dict[str, Any] | None]] = [("", {"name": session.name}), ("gyro", gyro)]
    parts += [(name, {"file": f"{name}.csv"}) for name, part in given.items() if part is not None]
    for sighting in session.sightings:
        keys = {"name": sighting.name, "readings_deg": sighting.reading_deg.tolist()}
        parts.append(("[sighting]", {**keys, "mirror": sighting.mirror}))
    platform = session.platform
    if platform is not None:
        keys = {
            "file": "platform.csv",
            "circle_sd_arcsec": platform.circle_sd_arcsec,
            "level_sd_arcsec": platform.level_sd_arcsec,
            "mirror": platform.mirror,
        }
        parts.append(("platform", keys))
    if session.magnetometer is not None:
        beside = {"file": "reference.csv", "axes": "NED", "noise_nT": session.reference_noise}
        parts += [
            ("magnetometer", {**magnetometer_keys(session), "noise_nT": session.noise}),
            ("reference", beside),
            ("pier", pier_keys(session)),
        ]
    return parts
