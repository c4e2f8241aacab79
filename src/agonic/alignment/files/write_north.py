"""`write_north`: a folder with north.toml and its tables, as `read_north` reads them."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from agonic.alignment.files.north_schema import GyroSection
from agonic.alignment.files.read_north import FILE_NAME, TABLES
from agonic.alignment.session.north import NorthSession
from agonic.atomic import make_folder, write_atomically
from agonic.exports.csv import write_csv
from agonic.files.calibration import save


def write_north(session: NorthSession, folder: Path | str) -> list[Path]:
    """Write north.toml and its tables, as `read_north` reads them; return their paths.

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
        write_atomically(home / f"{name}.csv", text_of_table(columns))
        for name, columns in tables.items()
    ]
    for samples, name in ((session.magnetometer, "magnetometer"), (session.reference, "reference")):
        if samples is not None:
            files.append(write_csv(samples, home / f"{name}.csv"))
    if session.calibration is not None:
        files.append(save(session.calibration, home / "calibration.json"))
    return [*files, write_atomically(home / FILE_NAME, _text(session))]


def text_of_table(columns: Mapping[str, ArrayLike]) -> str:
    """A table as CSV, numbers to their last digit."""
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(np.asarray(c).tolist() for c in columns.values()), strict=True))
    return stream.getvalue()


def _text(session: NorthSession) -> str:
    """north.toml."""
    gyro = {name: getattr(session, name) for name in GyroSection.__struct_fields__}
    lines = [f"name = {json.dumps(session.name)}", *section_text("gyro", gyro)]
    given = {"reversal": session.turning_deg, "transit": session.transits, "swing": session.swing}
    for name, part in given.items():
        if part is not None:
            lines += section_text(name, {"file": f"{name}.csv"})
    for sighting in session.sightings:
        lines += section_text(
            "[sighting]",
            {
                "name": sighting.name,
                "readings_deg": sighting.reading_deg.tolist(),
                "mirror": sighting.mirror,
            },
        )
    platform = session.platform
    if platform is not None:
        lines += section_text(
            "platform",
            {
                "file": "platform.csv",
                "circle_sd_arcsec": platform.circle_sd_arcsec,
                "level_sd_arcsec": platform.level_sd_arcsec,
                "mirror": platform.mirror,
            },
        )
    if session.magnetometer is not None:
        lines += section_text(
            "magnetometer",
            {
                "file": "magnetometer.csv",
                "noise_nT": session.noise,
                "calibration": None if session.calibration is None else "calibration.json",
            },
        )
        lines += section_text(
            "reference",
            {"file": "reference.csv", "axes": "NED", "noise_nT": session.reference_noise},
        )
        lines += section_text(
            "pier", {"difference_nT": session.pier.difference.tolist(), "sd_nT": session.pier.sd}
        )
    return "\n".join(lines) + "\n"


def section_text(name: str, keys: Mapping[str, Any]) -> list[str]:
    """A section of TOML; what is not known is left out."""
    return [
        "",
        f"[{name}]",
        *(
            f"{key} = {json.dumps(value, ensure_ascii=False)}"
            for key, value in keys.items()
            if value is not None
        ),
    ]
