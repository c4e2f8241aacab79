"""Long tables: each row is of the sensor that a column names (`time,sensor,x,y,z`), and x, y and z
are what that reads; or of the one channel that a column names (`time,channel,value,unit`)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Unpack

import numpy as np

from agonic.logs.contents import MOST_PARTS, to_number
from agonic.logs.groups import INERTIAL, build_groups_log
from agonic.logs.headers.columns import find_named_quantity, find_quantities, identify_columns
from agonic.logs.headers.header import identify_column
from agonic.logs.headers.quantities import FALLBACK
from agonic.logs.log import Facts, Log, Table
from agonic.logs.table import build_log

LABEL = "sensor"


def build_tables_log(table: Table, **facts: Unpack[Facts]) -> Log:
    """The log that a table is, those of its sensors apart where it is a long one."""
    parts = split_by_sensor(table)
    if parts is None:
        return build_log(table, **facts)
    return build_groups_log(parts, {name: Path(name) for name in parts}, **facts)


def name_label(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """The headers, with "sensor" for a column whose cells name a magnetometer and another sensor,
    whatever it is called: rows of both must not become one sensor's."""
    names = list(headers)
    if LABEL in find_quantities(names).values():
        return names
    for at, name in enumerate(names):
        if identify_column(name) is not None:
            continue
        cells = {row[at].strip() for row in rows if at < len(row)}
        if len(cells) > MOST_PARTS or not any(cell[:1].isalpha() for cell in cells):
            continue
        named = {find_named_quantity(cell) for cell in cells if cell}
        if "field" in named and named & INERTIAL.keys():
            return [*names[:at], LABEL, *names[at + 1 :]]
    return names


def split_by_sensor(table: Table) -> dict[str, Table] | None:
    """The tables of the sensors that a long one holds; `None` where it is none. Rows of something
    that is neither a magnetometer, an accelerometer nor a gyroscope are left out."""
    found = identify_columns(table)
    label = found.get("sensor", {}).get("", {}).get("")
    bare = found.get("field", {}).get("", {})
    if label is None or set(bare) != set("xyz"):
        return None
    names = np.array([str(name).strip() for name in table[label.header]])
    quantities = {
        name: find_named_quantity(name) for name in np.unique(names)[:MOST_PARTS].tolist()
    }
    if "field" not in quantities.values() or len(set(quantities.values())) < 2:
        return None
    axes = {column.header: axis for axis, column in bare.items()}
    parts: dict[str, Table] = {}
    for name, quantity in quantities.items():
        if quantity not in ("field", *INERTIAL):
            continue
        rows = names == name
        parts[name] = {
            f"{name} {axes[header]}" if header in axes and quantity != "field" else header: c[rows]
            for header, c in table.items()
            if header != label.header
        }
    return parts


class Channels(NamedTuple):
    """The columns of a table with a channel a row: its name, its value, its unit, its time."""

    name: int
    value: int
    unit: int | None
    time: int | None


def find_channels(header: Sequence[str], rows: Sequence[Sequence[str]]) -> Channels | None:
    """The columns of a table with a channel a row, where those are the axes of a field at least."""
    known = list(find_quantities(header).values())
    free = [at for at, quantity in enumerate(known) if quantity in ("", "sensor")]
    if "field" in known or len(free) < 2:
        return None
    for at in free:
        cells = {row[at] for row in rows if at < len(row)}
        if not 3 <= len(cells) <= MOST_PARTS or not any(cell[:1].isalpha() for cell in cells):
            continue
        named = [column for cell in cells if (column := identify_column(cell)) is not None]
        axes = {c.axis for c in named if c.quantity.column == "field" and c.rank != FALLBACK}
        values = [
            k
            for k in free
            if k != at and not any(math.isnan(to_number(row[k])) for row in rows if k < len(row))
        ]
        if axes == set("xyz") and len(values) == 1:
            unit, time = (known.index(q) if q in known else None for q in ("unit", "time"))
            return Channels(at, values[0], unit, time)
    return None


def gather_channels(
    columns: Channels, header: Sequence[str], rows: Iterable[Sequence[str]]
) -> list[dict[str, Any]]:
    """The values by channel, a record for each time; without times, until one comes again."""
    records: list[dict[str, Any]] = []
    at: dict[str, int] = {}
    last = max(one for one in columns if one is not None)
    for row in rows:
        if len(row) <= last:
            continue
        unit = "" if columns.unit is None else row[columns.unit]
        name = f"{row[columns.name]} ({unit})" if unit else row[columns.name]
        time = "" if columns.time is None else row[columns.time]
        place = at.get(time)
        if place is None or name in records[place]:
            at[time] = place = len(records)
            records.append({} if columns.time is None else {header[columns.time]: time})
        records[place][name] = row[columns.value]
    return records
