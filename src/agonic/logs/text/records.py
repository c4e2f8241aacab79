"""Readings that name themselves, as tables: objects with values by name, and channels a row each.

Names within names are joined by dots (`mag.x`), a list of three numbers is a vector (`mag[0]`), and
numbers may be written as texts. Otherwise columns are named as those of a text table are. In a long
table of channels each row holds one reading, by `time,channel,value,unit`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.logs.contents import DEEPEST, MOST_PARTS, to_number
from agonic.logs.groups import name_label
from agonic.logs.headers.column_names import rename_headers
from agonic.logs.headers.columns import find_columns, find_quantities, refuse_many
from agonic.logs.headers.header import identify_column
from agonic.logs.headers.quantities import FALLBACK, squash
from agonic.logs.text.layout import SAMPLE, tell_field

Record = dict[str, Any]
TEXTUAL = ("time", "date", "sensor", "frame", "unit", "target")


def make_table(records: list[Record]) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """The columns of objects that are understood, by name, and the names of the others."""
    columns = _make_columns(records)
    names = list(columns)
    texts = [[v if isinstance(v, str) else "" for v in columns[name][:SAMPLE]] for name in names]
    wanted = find_columns(rename_headers(name_label(names, list(zip(*texts, strict=True)))))
    quantities = find_quantities(wanted.values())
    table = {
        name: to_column(columns[names[i]], textual=quantities[name] in TEXTUAL)
        for i, name in wanted.items()
    }
    return table, [name for i, name in enumerate(names) if i not in wanted]


def _make_columns(records: list[Record]) -> dict[str, list[Any]]:
    """Lists of one length by name; `None` where a record lacks it."""
    rows = [one for record in records for one in _unpack(record)]
    names: dict[str, None] = {}
    for row in rows:
        names |= dict.fromkeys(row)
        refuse_many(len(names), "names")
    return {name: [row.get(name) for row in rows] for name in names}


def _unpack(record: Record) -> list[Record]:
    """The values of an object by dotted names, of a list of three or four by [0], [1], …; a packet
    of several readings, whose lists of objects have one length, as so many records."""
    flat = list(_flatten(record))
    lists = {name: v for name, v in flat if isinstance(v, list) and v and are_objects(v)}
    count = {len(values) for values in lists.values()}
    if len(count) != 1:
        return [dict(_number_parts(flat))]
    taken = (
        [part for n, v in flat for part in (_flatten(v[k], f"{n}.") if n in lists else [(n, v)])]
        for k in range(count.pop())
    )
    return [dict(_number_parts(parts)) for parts in taken]


def are_objects(values: list[Any]) -> bool:
    return all(isinstance(value, dict) for value in values)


def _flatten(
    record: Mapping[str, Any], before: str = "", depth: int = 0
) -> Iterator[tuple[str, Any]]:
    """The values of an object by dotted names."""
    for key, value in record.items():
        if not isinstance(value, dict):
            yield f"{before}{key}", value
        elif depth < DEEPEST:
            yield from _flatten(value, f"{before}{key}.", depth + 1)


def _number_parts(values: Iterable[tuple[str, Any]]) -> Iterator[tuple[str, Any]]:
    """The values, of a list of three or four by [0], [1], …, without other lists."""
    for name, value in values:
        if not isinstance(value, list):
            yield name, value
        elif len(value) in (3, 4):
            yield from ((f"{name}[{k}]", one) for k, one in enumerate(value))


def to_column(column: list[Any], *, textual: bool) -> NDArray[Any]:
    """A column as numbers; as texts where it may hold such and does."""
    numbers = np.array([_number(value) for value in column], dtype=np.float64)
    known = sum(value is not None for value in column)
    if textual and 2 * np.isfinite(numbers).sum() < known:
        return np.array(["" if v is None else str(v) for v in column], dtype=object)
    return numbers


def _number(value: Any) -> float:
    with suppress(OverflowError, ValueError):
        return float(value) if isinstance(value, int | float | str) else np.nan
    return np.nan


class Channels(NamedTuple):
    """The columns of a table with a channel a row: its name, its value, its unit, its time."""

    name: int
    value: int
    unit: int | None
    time: int | None

    def read(self, header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[Record]:
        """The values by channel, a record for each time."""
        last = max(at for at in self if at is not None)
        readings = (
            (
                "" if self.time is None else row[self.time],
                name_unit(row[self.name], "" if self.unit is None else row[self.unit]),
                row[self.value],
            )
            for row in rows
            if len(row) > last
        )
        return gather_channels(readings, "" if self.time is None else header[self.time])


def name_unit(name: str, unit: str) -> str:
    """A name with the unit of what it stands for."""
    return f"{name} ({unit})" if unit else name


def gather_channels(readings: Iterable[tuple[str, str, str]], clock: str) -> list[Record]:
    """Times, channels and values as a record for each time; without times, or where the axes of a
    field have times of their own, until a channel comes again, at the time of the first. `clock` is
    the name of the times."""
    every = list(readings)
    together, by_turns = (_gather(every, clock, by_time=one) for one in (True, False))
    fields = [sum(map(tell_field, records[:SAMPLE])) for records in (together, by_turns)]
    return by_turns if fields[1] > fields[0] else together


def _gather(readings: Iterable[tuple[str, str, str]], clock: str, *, by_time: bool) -> list[Record]:
    records: list[Record] = []
    at: dict[str, int] = {}
    for time, name, value in readings:
        key = time if by_time else ""
        place = at.get(key)
        if place is None or name in records[place]:
            at[key] = place = len(records)
            records.append({clock: time} if time else {})
        records[place][name] = value
    return records


_VALUES = ("value", "reading", "val")
"""What the column of a reading is called beside other numbers."""


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
        called = [k for k in values if squash(header[k]).lower() in _VALUES]
        values = called if len(values) > 1 else values
        if axes == set("xyz") and len(values) == 1:
            unit, time = (known.index(q) if q in known else None for q in ("unit", "time"))
            return Channels(at, values[0], unit, time)
    return None
