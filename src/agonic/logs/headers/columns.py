"""What a column of a table holds, told by its name: the canonical names and the aliases.

A canonical name is the quantity, the axis and the unit: `time_s`, `mag_x_nT`, `temperature_C`,
`acc_x_m_s2`. Loggers write other things, and `QUANTITIES` is the table of what is understood.
Case, blanks and punctuation do not count, so `Magnetometer X (uT)`, `magnetometer.x [µT]` and
`MagX_uT` are one name. The axis may stand before, within or after the name (`xmag`, `mag1_x`,
`magnetometer_ga[0]`), and so may the number of a sensor (`mag2_x`, `mag_x_2`, `imu2.mag.x`).

What stands before such a name is the sensor (`mmc_x_uT`, `/front/mag/magnetic_field/x`), unless a
word there says that the column is no reading (`bias`, `std`, `expected`).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence

from agonic.errors import LogError
from agonic.logs.headers.header import MOST_COLUMNS
from agonic.logs.headers.header import Column as Column
from agonic.logs.headers.header import identify_column as identify_column
from agonic.logs.headers.quantities import LAST


def refuse_many(count: int, what: str = "") -> None:
    """Raise `LogError` for a table of more than `MOST_COLUMNS`, or so many arrays or variables."""
    if count > MOST_COLUMNS:
        many = f"it holds more than {MOST_COLUMNS} {what}: this is no log"
        raise LogError(many if what else f"{count} columns: more than {MOST_COLUMNS} are no log")


def find_columns(headers: Sequence[str]) -> dict[int, str]:
    """The columns that are understood, by position; none may be there twice."""
    refuse_many(len(headers))
    sensors = _name_sensors(headers)
    found = {i: h for i, h in enumerate(headers) if identify_column(h, sensors) is not None}
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
