"""north.toml: what a gyrotheodolite read, what was sighted, and a platform turned beside it.

Its keys are those of the sections in `description`; docs/jobs/find-true-north.md shows it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from agonic.alignment.files.description import (
    NORTH,
    Description,
    GyroSection,
    Head,
    PlatformSection,
    SightingSection,
    read_description,
)
from agonic.alignment.files.star_table import GON_DEG, read_table
from agonic.alignment.session.laboratory import (
    NorthSession,
    Platform,
    Sighting,
    SwingRecord,
    Transits,
)
from agonic.arrays import Array
from agonic.files.toml_sections import read_section

Columns = dict[str, Array]

FILE_NAME = "north.toml"


TABLES = {
    "reversal": ("reading_deg",),
    "transit": ("setting_deg", "east_s", "west_s", "amplitude_east", "amplitude_west"),
    "swing": ("time_s", "reading_deg"),
    "platform": ("orientation", "reading_deg", "roll_deg", "pitch_deg"),
}
"""Columns of the tables; angles of the circle in gon too."""


def read_north(path: Path | str) -> NorthSession:
    """The session that a north.toml describes, with its tables.

    Parameters
    ----------
    path : the file, or the folder that it is in.

    Returns a `NorthSession`, angles in degrees. Raises `LogError` that names every mistake of the
    description at once, and `AgonicError` where its parts do not belong together.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.alignment.files.write import write_north
    >>> from agonic.alignment.simulation.north import simulate_north
    >>> with TemporaryDirectory() as folder:
    ...     _ = write_north(simulate_north(orientations=0).session, folder)
    ...     len(read_north(folder).turning_deg)
    8
    """
    description = read_description(path, FILE_NAME, Head, NORTH, beside=("sighting",))
    parts = description.parts
    sightings = _sightings(description.table.get("sighting", []), description.mistakes)
    description.require()
    tables = {
        name: _read_table(description, parts[name].file, names)
        for name, names in TABLES.items()
        if parts[name] is not None
    }
    gyro = parts["gyro"] or GyroSection()
    magnetometer, reference = parts["magnetometer"], parts["reference"]
    return NorthSession(
        name=description.head.name,
        turning_deg=tables["reversal"]["reading_deg"] if "reversal" in tables else None,
        transits=Transits(**tables["transit"]) if "transit" in tables else None,
        swing=SwingRecord(**tables["swing"]) if "swing" in tables else None,
        **{name: getattr(gyro, name) for name in GyroSection.__struct_fields__},
        sightings=sightings,
        platform=_platform(tables, parts["platform"]),
        magnetometer=None if magnetometer is None else description.read_samples(magnetometer),
        reference=description.read_reference(),
        pier=description.make_pier(),
        calibration=description.load_calibration(),
        noise=None if magnetometer is None else magnetometer.noise_nT,
        reference_noise=None if reference is None else reference.noise_nT,
        sources=tuple(description.sources),
    )


def _sightings(given: Any, mistakes: list[str]) -> tuple[Sighting, ...]:
    if not isinstance(given, list):
        mistakes.append("sightings are written [[sighting]], once for each")
        return ()
    made = []
    for number, each in enumerate(given, start=1):
        part = read_section(each, SightingSection, f"[[sighting]] {number}", mistakes)
        if part is None:
            continue
        if (part.readings_deg is None) == (part.readings_gon is None):
            mistakes.append(f"[[sighting]] {number} needs readings_deg or readings_gon")
            continue
        degrees = part.readings_deg or [GON_DEG * value for value in part.readings_gon or []]
        if not degrees:
            mistakes.append(f"[[sighting]] {number} has no readings")
            continue
        made.append(Sighting(name=part.name, reading_deg=np.array(degrees), mirror=part.mirror))
    return tuple(made)


def _platform(tables: Mapping[str, Columns], part: PlatformSection | None) -> Platform | None:
    if part is None:
        return None
    columns = tables["platform"]
    return Platform(
        orientation=columns["orientation"].astype(np.int64),
        reading_deg=columns["reading_deg"],
        roll_deg=columns["roll_deg"],
        pitch_deg=columns["pitch_deg"],
        circle_sd_arcsec=part.circle_sd_arcsec,
        level_sd_arcsec=part.level_sd_arcsec,
        mirror=part.mirror,
    )


def _read_table(description: Description, file: str, names: tuple[str, ...]) -> Columns:
    """The columns of a table by name, angles in degrees."""
    table = read_table(description.home / file, f"a CSV table of {', '.join(names)}")
    description.add_source(file, len(table))
    return table.read_angles(names)
