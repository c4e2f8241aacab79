"""campaign.toml: what the recordings of a climatic chamber are about.

name = "Five magnetometers, -10 to +50 °C"
files = "station-{station:02d}.csv"   # or "{board}_pos{station:02d}.csv", or one file or a pattern
unit = "uT"                           # of the field, where the files do not say
rate_Hz = 10
fixture_sd_deg = 1.0                  # how well the turns of the fixture are known
columns = { time = "t" }              # what headers do not say, as with --columns

[[sensor]]
name = "MMC5883MA-1"
column = "mag1"                       # what the files call it; may be left out, as all below
model = "MMC5883MA"
noise_nT = 100
board = "computer"
temperature_of = "MPU-9255-1"         # where its own thermometer failed
columns = { x = "A1", y = "A2", z = "A3", temperature = "T1_C" }   # any headers

[[station]]                           # without any: the standard twelve
number = 1
file = "first.csv"                    # where it does not follow `files`
pose = "top up, front to the north"   # of its own without angles: the turn is unknown
roll_deg = 0                          # from the axes of the box to those of the chamber
pitch_deg = 0
heading_deg = 0

[profile]
lowest_C = -10
highest_C = 50
hold_min = 15
cooling_C_per_min = 0.5

[field]                               # of the chamber, where it is known
magnitude_nT = 48000
inclination_deg = 65
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from string import Formatter
from typing import Any

import msgspec
from msgspec import Struct

from agonic.errors import LogError
from agonic.files.toml_sections import read_section, read_toml, try_to_make
from agonic.logs.headers.column_names import ColumnNames, parse_names
from agonic.maths.rotations.attitude import yaw_pitch_roll
from agonic.thermal.campaign.description import (
    Description,
    Sensor,
    Station,
    find_repeated,
    list_standard_stations,
)
from agonic.thermal.campaign.profile import Profile
from agonic.units import find_unit

FILE_NAME = "campaign.toml"


class CampaignSection(Struct):
    """What stands before the first section."""

    name: str = ""
    files: str = ""
    unit: str | None = None
    rate_Hz: float | None = None
    fixture_sd_deg: float = 1.0
    columns: dict[str, str] = {}


class SensorSection(Struct):
    """One [[sensor]]."""

    name: str
    column: str = ""
    model: str = ""
    unit: str | None = None
    noise_nT: float | None = None
    board: str = ""
    temperature_of: str = ""
    columns: dict[str, str] = {}


class StationSection(Struct):
    """One [[station]]."""

    number: int
    file: str = ""
    pose: str = ""
    roll_deg: float | None = None
    pitch_deg: float | None = None
    heading_deg: float | None = None


class FieldSection(Struct):
    """[field]"""

    magnitude_nT: float | None = None
    inclination_deg: float | None = None


SECTIONS = ("sensor", "station", "profile", "field")


def read_description(path: Path | str) -> Description:
    """The description in a campaign.toml.

    Raises `LogError` that names every mistake in it at once: words that mean nothing, values of
    the wrong kind, things described twice, files that are not there.
    """
    file = Path(path)
    table = read_toml(file)
    mistakes: list[str] = []
    description = _make_description(table, file.parent, mistakes)
    if mistakes or description is None:
        raise LogError("; ".join(mistakes), path=file)
    return description


def _make_description(
    table: Mapping[str, Any], folder: Path, mistakes: list[str]
) -> Description | None:
    """The description, with what is wrong added to `mistakes`."""
    plain = {key: value for key, value in table.items() if key not in SECTIONS}
    head = read_section(plain, CampaignSection, "the file", mistakes, SECTIONS)
    profile = read_section(table.get("profile"), Profile, "[profile]", mistakes)
    field = read_section(table.get("field", {}), FieldSection, "[field]", mistakes)
    sensors = _read_sections(table.get("sensor", []), SensorSection, "sensor", mistakes)
    stations = _read_sections(table.get("station", []), StationSection, "station", mistakes)
    _check_names(sensors, stations, mistakes)
    _check_columns(head, sensors, mistakes)
    _check_values(head, field, sensors, mistakes)
    _check_files(head, stations, folder, mistakes)
    if mistakes:
        return None
    return Description(
        name=head.name,
        files=head.files,
        rate_Hz=head.rate_Hz,
        fixture_sd_deg=head.fixture_sd_deg,
        sensors=tuple(_make_sensor(one, head.unit) for one in sensors),
        stations=tuple(map(_make_station, stations)) or list_standard_stations(),
        assumed=not stations,
        profile=profile,
        magnitude=field.magnitude_nT,
        inclination_deg=field.inclination_deg,
        unit=head.unit,
        columns=head.columns,
    )


def _read_sections(tables: Any, kind: type[Struct], what: str, mistakes: list[str]) -> list[Any]:
    """Every [[sensor]] or [[station]] that is as it should be."""
    if not isinstance(tables, list):
        mistakes.append(f"write [[{what}]] with two brackets: there may be several")
        return []
    made = [
        read_section(table, kind, f"[[{what}]] {k}", mistakes) for k, table in enumerate(tables, 1)
    ]
    return [one for one in made if one is not None]


def _check_names(sensors: list[Any], stations: list[Any], mistakes: list[str]) -> None:
    """Nothing is there twice, and temperatures come from sensors that exist."""
    names = [sensor.name for sensor in sensors]
    for what, given in (
        ("sensor", names),
        (
            "column",
            [
                (f"{sensor.column} of {sensor.board}" if sensor.board else sensor.column)
                for sensor in sensors
                if sensor.column
            ],
        ),
        ("station", [station.number for station in stations]),
        ("file", [station.file for station in stations if station.file]),
    ):
        mistakes += [f"{what} {value!r} is described twice" for value in find_repeated(given)]
    mistakes += [
        f"[[sensor]] {s.name}: temperature_of {s.temperature_of!r} is not a sensor of the file"
        for s in sensors
        if s.temperature_of and s.temperature_of not in names
    ]
    for station in stations:
        given = [station.roll_deg, station.pitch_deg, station.heading_deg]
        if any(angle is not None for angle in given) and None in given:
            mistakes.append(
                f"[[station]] {station.number}: roll_deg, pitch_deg and heading_deg go together"
            )


def _check_columns(head: Any, sensors: list[Any], mistakes: list[str]) -> None:
    """Columns are named for quantities that exist, and a magnetometer has three."""
    named = [("the file", head.columns if head else {})]
    named += [(f"[[sensor]] {sensor.name}", sensor.columns) for sensor in sensors]
    for where, columns in named:
        try_to_make(lambda columns=columns: parse_names(columns, "columns"), where, mistakes)  # type: ignore[misc]
        axes = [axis for axis in "xyz" if axis in columns]
        if 0 < len(axes) < 3:
            mistakes.append(f"{where}: columns names {', '.join(axes)} only of x, y and z")


def _check_values(head: Any, field: Any, sensors: list[Any], mistakes: list[str]) -> None:
    """Units that exist, and numbers above zero."""
    units = [("the file", head.unit if head else None), *((s.name, s.unit) for s in sensors)]
    for where, unit in units:
        try_to_make(lambda unit=unit: find_unit(unit) if unit else "", where, mistakes)  # type: ignore[misc]
    above = [("rate_Hz", head.rate_Hz if head else None)]
    above += [("magnitude_nT", field.magnitude_nT if field else None)]
    above += [(f"{sensor.name}: noise_nT", sensor.noise_nT) for sensor in sensors]
    mistakes += [
        f"{name} is {value:g}; it must be above 0"
        for name, value in above
        if value is not None and not value > 0
    ]


def _check_files(head: Any, stations: list[Any], folder: Path, mistakes: list[str]) -> None:
    """Files that are named one by one must be there; a pattern must be one."""
    absent = [s.file for s in stations if s.file and not (folder / s.file).is_file()]
    if absent:
        mistakes.append(f"there is no file {', '.join(absent)} in {folder}")
    if head is None or "{" not in head.files:
        return
    try:
        named = {name for _, name, _, _ in Formatter().parse(head.files) if name is not None}
        head.files.format(station=1, board="a")
    except (ValueError, KeyError, IndexError):
        named = set()
    if not named or named - {"station", "board"}:
        mistakes.append(
            f"files = {head.files!r} is not a pattern; write station-{{station:02d}}.csv, or "
            "{board}_{station:02d}.csv with the board of every [[sensor]]"
        )


def _make_sensor(section: SensorSection, unit: str | None) -> Sensor:
    given = msgspec.structs.asdict(section)
    noise = given.pop("noise_nT")
    return Sensor(**{**given, "noise": noise, "unit": section.unit or unit})


def _make_station(section: StationSection) -> Station:
    """A station; one of the standard twelve where only its number is given.

    A pose of its own without angles says that it stands otherwise, and not how.
    """
    plain = Station(number=section.number, pose=section.pose, file=section.file)
    if section.roll_deg is None:
        standard = {one.number: one for one in list_standard_stations()}.get(section.number)
        if standard is None or section.pose not in ("", standard.pose):
            return plain
        return replace(plain, pose=standard.pose, rot_nb=standard.rot_nb)
    turned = yaw_pitch_roll(section.heading_deg or 0.0, section.pitch_deg or 0.0, section.roll_deg)
    return replace(plain, rot_nb=turned)


_FIRST = 901
"""The number of the first sensor whose axes are named: above what loggers count to."""
_NAME = re.compile(r"([a-z]+)(.*)", re.IGNORECASE)


def name_columns(description: Description, board: str = "") -> ColumnNames | None:
    """The names of the columns in the files of a board, or `None` where none are given.

    Every sensor whose columns are named gets a number, so that several in a file are told apart; a
    column that several share is nobody's.
    """
    named = dict(description.columns)
    for number, sensor in enumerate(description.sensors, start=_FIRST):
        if board and sensor.board and sensor.board.casefold() != board.casefold():
            continue
        named |= _name_own(sensor, f"{number}", named)
    if not named:
        return None
    return ColumnNames(headers=named, where=FILE_NAME, several=True)


def find_label(sensor: Sensor, sensors: Sequence[Sensor]) -> str:
    """What the readings of a sensor are called in the files after their columns were named."""
    named = sensor.columns.get("x") and sensor in sensors
    return f"mag{_FIRST + list(sensors).index(sensor)}" if named else sensor.column


def _name_own(sensor: Sensor, number: str, before: Mapping[str, str]) -> dict[str, str]:
    """The names of a sensor's columns; one that has been named before is shared."""
    label = number if "x" in sensor.columns else _strip_name(sensor.column or sensor.name)
    made = {}
    for name, header in sensor.columns.items():
        if name in "xyz":
            made[f"mag{label}_{name}"] = header
        elif header in before.values():
            made[name] = header
        elif label.isdecimal() or not label:
            made[_NAME.sub(rf"\g<1>{label}\g<2>", name, count=1)] = header
        else:
            made[f"{label}_{name}"] = header
    return made


def _strip_name(name: str) -> str:
    """The number of a sensor that is called by one: 2 of mag2."""
    return name.removeprefix("mag") if name.removeprefix("mag").isdecimal() else name
