"""A table of named columns, made into a `Samples` for each magnetometer in it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from agonic.arrays import Array, Index
from agonic.errors import LogError
from agonic.logs.auxiliary import Table, convert_column, set_angle_unit, to_numbers
from agonic.logs.clock import UNIX, Clock, read_clock, spread_ties
from agonic.logs.columns import FALLBACK, Column, Identified, identify_column, identify_columns
from agonic.logs.log import Log, Stream
from agonic.logs.resample import compute_rate_Hz, find_misplaced
from agonic.provenance import Input
from agonic.samples import COLUMNS, Samples
from agonic.units import RAW, find_unit, nanotesla_per

AUXILIARY = tuple(name for name in COLUMNS if name not in ("time", "field"))
YAW = "a heading called yaw was taken for the estimate of a filter, which follows its magnetometer"

_CLOCK_SHARE = 0.9
"""Share of rows that must have a time, for the others to be given up rather than the clock."""
_MOST_SENSORS = 64
_YEAR_9999 = 2.5e11  # Unix seconds; the last year that Python's dates have


def build_log(
    table: Table,
    *,
    path: Path,
    source: Input,
    format: str,
    unit: str | None = None,
    others: Iterable[str] = (),
    notes: tuple[str, ...] = (),
    remarks: tuple[str, ...] = (),
) -> Log:
    """The log that a table is: its magnetometers with their columns, and what else it holds.

    `table` maps a header to its (n,) values: numbers, moments or texts. `unit` is that of the
    field where the header names none; `others` are headers that were not read; `notes` are on
    the file, `remarks` on each of its magnetometers.

    Raises `LogError` where no magnetometer is found, or two columns could be the same thing.
    """
    found = set_angle_unit(identify_columns(table), table)
    fields = [n for n, axes in found.get("field", {}).items() if len(axes) == 3]
    if not fields:
        raise LogError(_no_magnetometer(found, [*table, *others]))
    whole = _Part(
        table=table,
        found=found,
        rows=np.arange(len(next(iter(table.values())))),
        clock=_find_clock(table, found),
        unit=unit,
        source=source,
        remarks=remarks,
    )
    sensors, failures = _read_sensors(whole, fields)
    return Log(
        path=path,
        format=format,
        source=source,
        sensors=sensors,
        streams=_list_streams(table, found, others, sensors[0]),
        notes=(*notes, *failures),
    )


@dataclass(frozen=True, kw_only=True)
class _Part:
    """The rows of a table that belong to one sensor, with what is known of all of them."""

    table: Table
    found: Identified
    rows: Index
    clock: Clock
    unit: str | None
    source: Input
    remarks: tuple[str, ...]

    def values(self, axes: Mapping[str, Column]) -> Array:
        """The numbers in the columns of a quantity, (n, k), axes in alphabetical order."""
        return np.stack(
            [to_numbers(self.table[axes[a].header])[self.rows] for a in sorted(axes)], 1
        )


def _read_sensors(whole: _Part, fields: list[str]) -> tuple[tuple[Samples, ...], list[str]]:
    """The magnetometers that have usable readings, and what is wrong with the others."""
    sensors, failures = [], []
    for label, rows in _split_rows(whole):
        for number in fields:
            name = _name(label, number)
            try:
                sensors.append(_read_sensor(replace(whole, rows=rows), name, number))
            except LogError as error:
                failures.append(f"{name}: {error}")
    if not sensors:
        raise LogError("; ".join(failures[:3]) or "none of its sensors is a magnetometer")
    return tuple(sensors), failures


def _read_sensor(part: _Part, name: str, number: str) -> Samples:
    """The samples of the magnetometer of that number, with the columns that go with it."""
    axes = part.found["field"][number]
    field = part.values(axes)
    unit, unit_notes = _field_unit(axes, part.unit)
    time, epoch, time_notes = _find_time(part, field)
    readings = np.asarray(np.isfinite(field).all(axis=1))
    columns: dict[str, Any] = {}
    estimated = False
    notes = [*part.remarks, *unit_notes, *time_notes]
    for column in AUXILIARY:
        if group := _pick(part.found.get(column, {}), number):
            columns[column], remarks = convert_column(group, part.values(group), time, readings)
            notes.extend(remarks)
            if column == "heading_deg" and _of_a_filter(group):
                estimated = True
                notes.append(YAW)
    if columns.get("second") is not None:  # `Samples` takes it in the unit of the field
        columns["second"] = columns["second"] / nanotesla_per(unit)
    return Samples(
        field=field,
        unit=unit,
        time=time,
        epoch=epoch,
        name=name,
        frame=_find_frame(part),
        heading_estimated=estimated,
        notes=tuple(notes),
        source=replace(part.source, count=len(field)),
        **columns,
    )


def _of_a_filter(group: Mapping[str, Column]) -> bool:
    """Whether a heading is called a yaw, as attitude filters call theirs."""
    return any("yaw" in column.header.lower() for column in group.values())


def _field_unit(axes: Mapping[str, Column], given: str | None) -> tuple[str, tuple[str, ...]]:
    """The unit that the headers name, else the given one, else raw."""
    units = {column.unit for column in axes.values()}
    if len(units) > 1:
        headers = ", ".join(column.header for column in axes.values())
        raise LogError(f"the axes are in different units ({headers}); give them one")
    named = units.pop()
    bare = ("no column is named for a magnetometer: x, y and z are taken as one",)
    notes = bare if named is None and axes["x"].rank == FALLBACK else ()
    if named in (None, RAW):
        if given is None:
            return RAW, (*notes, "the table names no unit: the field is left in raw units")
        return given, notes
    if given is not None and find_unit(given) != named:
        return named, (f"the headers say {named}: the given unit {given} is not used",)
    return named, ()


def _find_clock(table: Table, found: Identified) -> Clock:
    """The clock of all rows, from the time column, with a date column or an epoch if there is."""
    time, date, start = (
        _pick(found.get(name, {}), "").get("") for name in ("time", "date", "epoch")
    )
    if time is None:
        return read_clock(table[date.header], None) if date else (None, None, ())
    values = table[time.header]
    factor = time.quantity.units[time.unit][0] if time.unit else None
    if start is not None:
        moment = to_numbers(table[start.header])
        known = moment[(moment >= 0) & (moment < _YEAR_9999)]
        if len(known):
            epoch = UNIX + timedelta(seconds=float(known[0]))
            return to_numbers(values) * (factor or 1.0), epoch, ()
    if date is not None and values.dtype.kind in "OUS":
        texts = zip(table[date.header], values, strict=True)
        values = np.array([f"{day} {clock}" for day, clock in texts])
    return read_clock(values, factor)


def _find_time(part: _Part, field: Array) -> tuple[Array | None, datetime | None, tuple[str, ...]]:
    """The times of the rows, single wrong ones marked and a coarse clock spread."""
    whole, epoch, notes = part.clock
    if whole is None:
        return None, None, notes
    time = whole[part.rows]
    time[find_misplaced(time)] = np.nan
    known = time[np.isfinite(time)]
    if len(known) < _CLOCK_SHARE * len(time) or (len(known) > 1 and np.ptp(known) == 0):
        return None, None, (*notes, "times left out: the clock stands still or is mostly missing")
    time, remarks = spread_ties(time, field)
    return time, epoch, (*notes, *remarks)


def _find_frame(part: _Part) -> str:
    """The letter in a `frame` column, where all rows agree on one; "m" otherwise."""
    column = _pick(part.found.get("frame", {}), "").get("")
    letters = set() if column is None else set(map(str, part.table[column.header][part.rows]))
    letter = letters.pop() if len(letters) == 1 else ""
    return letter if len(letter) == 1 and letter.isalpha() else "m"


def _pick(groups: Mapping[str, Mapping[str, Column]], number: str) -> Mapping[str, Column]:
    """The columns of the sensor of that number, else those without one.

    A magnetometer without a number takes the only ones there are.
    """
    only = next(iter(groups.values())) if len(groups) == 1 and not number else {}
    return groups.get(number) or groups.get("") or only


def _split_rows(whole: _Part) -> Iterator[tuple[str, Index]]:
    """The rows of each sensor that a `sensor` column names, in order of appearance.

    A sensor whose own name says that it is an accelerometer or a gyroscope is left out.
    """
    column = _pick(whole.found.get("sensor", {}), "").get("")
    if column is None:
        yield "", whole.rows
        return
    labels = np.array([str(label).strip() for label in whole.table[column.header]])
    names, first, which = np.unique(labels, return_index=True, return_inverse=True)
    if len(names) > _MOST_SENSORS:
        raise LogError(f"{column.header!r} names {len(names)} sensors; is it another quantity?")
    for k in np.argsort(first):
        other = identify_column(f"{names[k]} x") if len(names[k]) > 1 else None
        if other is None or other.quantity.column == "field":
            yield str(names[k]), np.flatnonzero(which == k)


def _name(label: str, number: str) -> str:
    return " ".join(filter(None, (label, f"mag{number}" if number or not label else "")))


def _no_magnetometer(found: Identified, headers: list[str]) -> str:
    """What is there instead of a magnetometer, and what is needed."""
    parts = [c.header for axes in found.get("field", {}).values() for c in axes.values()]
    have = ", ".join(repr(h[:30]) for h in headers[:10]) + (", …" if len(headers) > 10 else "")
    part = f"only {', '.join(parts[:4])} of x, y and z" if parts else "no magnetometer columns"
    return f"{part} found among {have}; name them mag_x_uT, mag_y_uT, mag_z_uT or the like"


def _list_streams(
    table: Table, found: Identified, others: Iterable[str], first: Samples
) -> tuple[Stream, ...]:
    """The columns that no sensor could use."""
    used = {
        c.header for groups in found.values() for axes in groups.values() for c in axes.values()
    }
    rows = len(next(iter(table.values())))
    rate = None if first.time is None else compute_rate_Hz(first.time)
    unused = [*(header for header in table if header not in used), *others]
    return tuple(Stream(name=header, rows=rows, rate_Hz=rate) for header in unused)
