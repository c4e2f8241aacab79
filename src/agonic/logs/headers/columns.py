"""What a column of a table holds, told by its name: the canonical names and the aliases.

A canonical name is the quantity, the axis and the unit: `time_s`, `mag_x_nT`, `acc_x_m_s2`. Case,
blanks and punctuation do not count, and the axis, and the number of a sensor, may stand before,
within or after the name: `Magnetometer X (uT)`, `xmag`, `mag2_x`, `magnetometer_ga[0]`. What stands
before is the sensor (`mmc_x_uT`), unless a word says that the column is no reading (`bias`, `std`).

Where headers do not tell, units, clocks and quaternions are those that a format fixes in its
documents. It is known by marks among its headers; nothing is taken from the size of the numbers. A
unit that is given goes before a documented one, since drivers do not always keep to the documents.
"""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

from agonic.errors import LogError
from agonic.logs.headers.header import MOST_COLUMNS
from agonic.logs.headers.header import Column as Column
from agonic.logs.headers.header import identify_column as identify_column
from agonic.logs.headers.quantities import BY_COLUMN, FALLBACK, LAST


def refuse_many(count: int, what: str = "") -> None:
    """Raise `LogError` for a table of more than `MOST_COLUMNS`, or so many arrays or variables."""
    if count > MOST_COLUMNS:
        many = f"it holds more than {MOST_COLUMNS} {what}: this is no log"
        raise LogError(many if what else f"{count} columns: more than {MOST_COLUMNS} are no log")


def find_columns(headers: Sequence[str]) -> dict[int, str]:
    """The columns that are understood, by position; none may be there twice."""
    refuse_many(len(headers))
    known = find_quantities(headers)
    found = {i: h for i, h in enumerate(headers) if known[h]}
    for header, times in Counter(found.values()).items():
        if times > 1:
            raise LogError(f"the column {header!r} is there {times} times; rename or remove one")
    return found


def find_quantities(headers: Iterable[str]) -> dict[str, str]:
    """The quantity that each header names, "" where none; beside headers that name sensors."""
    headers = list(headers)
    sensors = _name_sensors(headers)
    found = {header: identify_column(header, sensors) for header in headers}
    return {header: "" if c is None else c.quantity.column for header, c in found.items()}


def _name_sensors(headers: Iterable[str]) -> frozenset[str]:
    """The names of magnetometers that the headers hold."""
    found = map(identify_column, headers)
    return frozenset(c.sensor for c in found if c and c.quantity.column == "field" and c.sensor)


Identified = dict[str, dict[str, dict[str, Column]]]
"""Columns by quantity, sensor and axis; "" where there is no sensor or axis."""


def identify_columns(headers: Iterable[str]) -> Identified:
    """The columns that are understood, the best name for each. Two that could be the same thing
    beside the field are left out; of the others, raises `LogError` naming both."""
    headers = list(headers)
    sensors = _name_sensors(headers)
    groups: dict[tuple[str, str], list[Column]] = {}
    for column in (identify_column(header, sensors) for header in headers):
        if column is not None:
            groups.setdefault((column.quantity.column, column.sensor), []).append(column)
    found: Identified = {}
    for (name, sensor), columns in groups.items():
        best = min(column.rank for column in columns)
        axes: dict[str, Column] = {}
        doubtful: set[str] = set()
        for column in (column for column in columns if column.rank == best):
            twin = axes.setdefault(column.axis, column)
            of_device = twin.header == "timestamp" and _OF_DEVICE.search(column.header)
            if of_device or twin is column or best == LAST or _add_fraction(axes, twin, column):
                continue
            if (preferred := _prefer(twin, column)) is not None:
                axes[column.axis] = preferred
            elif name in _BESIDE:
                doubtful.add(column.axis)
            else:
                what = " ".join(filter(None, (column.quantity.name, sensor, column.axis)))
                raise LogError(
                    f"{twin.header!r} and {column.header!r} could both be the {what} column; "
                    "rename or remove one of them, or say which with --columns"
                )
        if kept := {axis: column for axis, column in axes.items() if axis not in doubtful}:
            found.setdefault(name, {})[sensor] = kept
    return found


def map_columns(found: Identified, change: Callable[[Column], Column]) -> Identified:
    """What a function makes of each of the columns."""
    return {
        quantity: {
            sensor: {axis: change(column) for axis, column in axes.items()}
            for sensor, axes in groups.items()
        }
        for quantity, groups in found.items()
    }


_BESIDE = frozenset(
    (
        "temperature", "roll_deg", "pitch_deg", "heading_deg", "heading_sd_deg", "latitude_deg",
        "longitude_deg", "altitude_m", "current_A", "throttle",
    )
)  # fmt: skip
"""What is left out where two columns could be it; a magnetometer is calibrated without."""


def find_doubtful(headers: Iterable[str]) -> list[str]:
    """The columns of one quantity beside the field that were left out as there are several."""
    headers = list(headers)
    found = identify_columns(headers)
    known = find_quantities(headers)
    return [h for h in headers if known[h] in _BESIDE and known[h] not in found]


_RAW = re.compile(r"(?<![a-z])raw(?![a-z])|raw(?=[A-Z])|Raw(?![a-z])|(?<![A-Za-z])RAW(?![A-Za-z])")
_CHANGED = re.compile(
    r"(?i)(?<![a-z])(un)?(cal|calib|calibrated|comp|compensated|corr|corrected|filt|filtered|raw|"
    r"smooth|lpf)(?![a-z])|(?<=[a-z])(Raw|Cal|Corr|Comp|Filt)(?![a-z])|^raw(?=[A-Z])"
)
"""Words by which two columns of one field differ."""


def _prefer(one: Column, other: Column) -> Column | None:
    """Of two columns that could be the same, the raw one of a field, of others the one not raw."""
    raw = [_RAW.search(column.header) is not None for column in (one, other)]
    if raw[0] == raw[1] or one.unit != other.unit:
        return None
    return (
        (one if raw[0] else other) if one.quantity.column == "field" else (other if raw[0] else one)
    )


def find_rivals(headers: Iterable[str], axes: Mapping[str, Column]) -> list[str]:
    """The columns x, y, z of the same field that were not taken: calibrated beside raw."""
    taken = {column.header for column in axes.values()}
    rivals: dict[str, str] = {}
    for header in headers:
        if header in taken:
            continue
        column = identify_column(_CHANGED.sub("", header)) or identify_column(header)
        if column and column.quantity.column == "field" and column.sensor == axes["x"].sensor:
            rivals.setdefault(column.axis, header)
    return [rivals[axis] for axis in "xyz"] if len(rivals) == 3 else []


_OF_DEVICE = re.compile(r"^(?:\w+\.)?(?:TimeUS|time_usec|time_boot_ms)$")
"""What pymavlink writes beside "timestamp", which is Unix time of the same moment, first."""
FRACTION = "fraction"
"""The axis of the finer of two time columns: parts of the other's seconds, or its own clock."""


def _add_fraction(axes: dict[str, Column], twin: Column, column: Column) -> bool:
    """Whether two columns are times in different units, kept so; without one it is seconds."""
    if column.quantity.column != "time" or FRACTION in axes:
        return False
    by_factor = {c.quantity.units.get(c.unit or "", (1.0,))[0]: c for c in (twin, column)}
    if len(by_factor) == 1:
        return False
    axes[FRACTION], axes[""] = by_factor[min(by_factor)], by_factor[max(by_factor)]
    return True


@dataclass(frozen=True, kw_only=True)
class Convention:
    """A format of tables: a row of `tables` in `dialects.toml`, which says what each part is."""

    name: str
    marks: Sequence[str]
    units: Mapping[str, str] = field(default_factory=dict)
    columns: Mapping[str, str] = field(default_factory=dict)
    above: str = ""
    file: str = ""
    only: str = ""
    source: str = field(default="", compare=False)

    def fits(self, headers: Iterable[str], stem: str, title: str = "") -> bool:
        """Whether a table with these headers, in a file of that name, is of the format."""
        text = "\n".join(["", *headers, ""])
        found = (
            f"\n{name}\n" in text  # ^name$, which costs no compiling
            if (name := mark[1:-1]).isidentifier()
            else re.search(mark, text, re.MULTILINE)
            for mark in self.marks
        )
        return self.above in title and all(found) and bool(re.search(self.file, stem, re.I))


CORRECTED = "MAG of ArduPilot, already corrected by the autopilot; read its own log (.bin)"
OFFSETS = {"MagX", "OfsX", "MOX"}
"""Columns of the message MAG: its field has had the offsets added, and the motor term."""

_CORRECTED = re.compile(
    r"^Shimmer_\w+_CAL\b|^(?:motionMagneticField|locationHeading)[XYZ]\b|IMU\d?\.[xyz]mag$"
)
"""Fields that a device has corrected: Shimmer, iOS (Core Motion, Core Location), MAVLink."""
OF_DEVICE = (
    "the device had corrected these readings ({}); record uncorrected ones, if it gives them"
)


@cache
def read_dialects() -> dict[str, Any]:
    """The table of dialects, `dialects.toml`: rows of tables, of texts, and groups of messages."""
    return tomllib.loads((Path(__file__).parents[1] / "dialects.toml").read_text("utf-8"))


@cache
def list_conventions() -> tuple[Convention, ...]:
    """The formats of tables that document what their headers do not tell."""
    return tuple(Convention(**row) for row in read_dialects()["tables"])


def apply_conventions(
    found: Identified, headers: Iterable[str], stem: str
) -> tuple[Identified, tuple[str, ...]]:
    """The columns, with the units that the format of the table documents; and notes. `stem` is the
    name of the file without its ending, which tells what bare x, y and z are."""
    headers = list(headers)
    _refuse_other_sensor(found, stem)
    known = [one for one in list_conventions() if one.units and one.fits(headers, stem)]
    used: dict[str, list[str]] = {}

    def complete(column: Column) -> Column:
        """A column with the first unit that its format documents, if it names none itself."""
        quantity = column.quantity
        for one in known if column.unit is None else ():
            if quantity.column in one.units and re.search(one.only, column.header):
                used.setdefault(one.name, []).append(quantity.name)
                return replace(column, unit=one.units[quantity.column], documented=one.name)
        return column

    return map_columns(found, complete), tuple(
        f"{', '.join(dict.fromkeys(names))}: units as {format} documents"
        for format, names in used.items()
    )


def name_documented(headers: Sequence[str], title: str = "") -> list[str]:
    """The headers, those by canonical names that only the format of the table tells, or the lines
    above it."""
    known: dict[str, str] = {}
    for convention in list_conventions():
        if convention.columns and convention.fits(headers, "", title):
            known |= convention.columns
    return [known.get(header, header) for header in headers]


def is_corrected(axes: Mapping[str, Column]) -> bool:
    """Whether the columns of a field are of those that a device writes after its own correction."""
    return any(_CORRECTED.search(column.header) for column in axes.values())


def _refuse_other_sensor(found: Identified, stem: str) -> None:
    """Raise `LogError` where bare axes stand in a file that is named for another sensor."""
    axes = found.get("field", {}).get("", {})
    if not axes or any(len(column.header) > 1 for column in axes.values()):
        return
    if re.match(read_dialects()["others"], stem, re.IGNORECASE):
        raise LogError(
            f"its x, y and z are of no magnetometer, by the name of the file ({stem[:40]}); name "
            "the file of the magnetometer, or the folder of both"
        )
    other = find_named_quantity(stem)
    if other in ("acceleration", "rotation_rate"):
        name = BY_COLUMN[other].name
        raise LogError(
            f"its x, y and z are of the {name} that the file is named for, and no magnetometer; "
            "name the file of the magnetometer, or the folder of both"
        )


def find_named_quantity(name: str) -> str:
    """The vector quantity that a file, a table or a row is named for; "" where it is none."""
    words = re.split(r"[\W_]+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name))
    for text in (name, *words):
        column = identify_column(f"{text} x") if len(text) > 2 else None
        if column is not None and column.axis == "x" and column.rank != FALLBACK:
            return column.quantity.column
    return ""
