"""Tables with clocks of their own, as bags, structures, sheets and tagged lines hold them: one log.

Each table with a magnetometer gives its sensors; what they lack is taken from the other tables,
interpolated at their readings. A column is not carried over holes: where more than a few readings
have no row of the other table near them, it is left out, and a note says so.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from os.path import commonprefix  # of any texts
from pathlib import Path
from typing import Any, NamedTuple, Unpack

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.contents import MOST_PARTS
from agonic.logs.formats import Format
from agonic.logs.headers.columns import (
    apply_conventions,
    find_named_quantity,
    find_quantities,
    identify_columns,
)
from agonic.logs.headers.header import identify_column
from agonic.logs.headers.quantities import BY_COLUMN, FALLBACK
from agonic.logs.log import About, Facts, Log, Stream, Table
from agonic.logs.rows.auxiliary import (
    PERIODS_DEG,
    find_reach,
    measure_reach,
    resample,
    set_angle_unit,
)
from agonic.logs.rows.other_columns import AUXILIARY, Part, read_columns, read_disturbers
from agonic.logs.rows.times import find_clocks, find_time
from agonic.logs.table import build_log, refuse_no_magnetometer
from agonic.provenance import Input
from agonic.samples import Samples

INERTIAL = {"acceleration": "acc", "rotation_rate": "gyro"}
"""What is recorded beside a field in files and rows of its own, and how its columns are called."""


@dataclass(frozen=True, kw_only=True)
class Beside:
    """A table without a magnetometer: its columns in our units, at times of its own."""

    name: str
    time: Array | None
    epoch: datetime | None
    columns: Mapping[str, Array]
    rows: int
    estimated: bool
    notes: tuple[str, ...]


def name_axes(table: Table, name: str, *, alone: bool) -> dict[str, Any]:
    """The columns of a file, a sheet or a table: bare axes under the sensor that it is named for.
    Where it is not `alone` and named for no magnetometer, bare axes are of something else."""
    quantity = find_named_quantity(name)
    named = {}
    for header, values in table.items():
        column = identify_column(header)
        bare = column is not None and column.quantity.column == "field" and column.rank == FALLBACK
        if bare and quantity in INERTIAL:
            named[f"{INERTIAL[quantity]} {header}"] = values
        elif not bare or alone or quantity == "field":
            named[header] = values
    return named


def build_groups_log(
    groups: Mapping[str, Table] | Mapping[int, Table],
    paths: Mapping[str, Path] | None = None,
    said_of: Mapping[str, tuple[str, ...]] | None = None,
    corrected: Mapping[str, str] | None = None,
    **facts: Unpack[Facts],
) -> Log:
    """The log that tables are, by the name of each, or a number where they have none. `paths` are
    files of the tables, where they have their own, `said_of` remarks on the readings of each, and
    `corrected` how those had been before they were written. The rest as for `build_log`."""
    others = tuple(facts.get("others", ()))
    logs, beside, failures = [], [], []
    for key, table in groups.items():
        name = key if isinstance(key, str) else ""
        if not table:
            continue
        path = (paths or {}).get(name, facts["path"])
        try:
            fields = identify_columns(table).get("field", {})
            if any(len(axes) == 3 for axes in fields.values()):
                said = (*facts.get("remarks", ()), *(said_of or {}).get(name, ()))
                own: Facts = {**facts, "path": path, "others": (), "notes": (), "remarks": said}
                log = build_log(table, **own)
                logs.append((name, _mark_corrected(log, (corrected or {}).get(name, ""))))
            else:
                beside.append(read_beside(name, table, path))
        except LogError as error:
            failures.append(f"{name or 'a table'}: {error}")
    if not logs:
        if failures:
            raise LogError("; ".join(failures[:3]))
        refuse_no_magnetometer([header for table in groups.values() for header in table], others)
    known: Counter[str] = Counter()
    sensors = []
    for group, those, samples in ((g, log.sensors, one) for g, log in logs for one in log.sensors):
        alone = len(those) == 1 and samples.name == "mag"
        name = (group if alone else f"{group} {samples.name}") if group else samples.name
        known[name] += 1
        numbered = name if known[name] == 1 else f"{name} #{known[name]}"
        sensors.append(_complete(samples, group, beside).with_columns(name=numbered))
    streams = [stream for _, log in logs for stream in log.streams]
    streams += [Stream.at(one.name, one.rows, one.time) for one in beside if one.name]
    streams += [Stream(name=name, rows=0) for name in others]
    return Log.of(facts, sensors, streams, (*(n for _, log in logs for n in log.notes), *failures))


def read_beside(name: str, table: Table, path: Path) -> Beside:
    """The columns of a table without a magnetometer; those of its first sensor."""
    found, documented = apply_conventions(identify_columns(table), table, path.stem)
    found = set_angle_unit(found, table)
    rows = len(next(iter(table.values())))
    number = next((n for q, groups in found.items() if q != "time" for n in groups), "")
    source = Input(name=name, sha256="", count=rows)
    clocks = find_clocks(table, found, [number])
    part = Part(table=table, found=found, rows=None, clocks=clocks, source=source)
    every = np.ones(rows, dtype=bool)
    time, epoch, notes = find_time(part.clock(number), np.zeros((rows, 3)), every)
    columns, estimated, remarks = read_columns(part, number, time, ~every)
    disturbers, said = read_disturbers(part, time, ~every)
    return Beside(
        name=name,
        time=time,
        epoch=epoch,
        columns={n: values for n, values in columns.items() if values is not None} | disturbers,
        rows=rows,
        estimated=estimated,
        notes=(*documented, *(notes if time is None else ()), *remarks, *said),
    )


def _complete(samples: Samples, group: str, beside: Iterable[Beside]) -> Samples:
    """The samples with the columns that they lack, of the tables named nearest to theirs first."""
    columns: dict[str, Any] = {}
    notes = list(samples.notes)
    estimated = samples.heading_estimated
    for other in sorted(beside, key=lambda one: -len(commonprefix((group, one.name)))):  # noqa: RUF071
        have = samples.columns().keys() | columns.keys()
        wanted = [name for name in other.columns if name not in have]
        if not wanted:
            left_out = () if other.columns else other.notes
            notes.extend(f"{other.name}: {n}" for n in left_out if "left out" in n and other.name)
            continue
        shift = _find_shift(samples, other)
        if isinstance(shift, str):
            notes.append(f"{other.name or 'another table'} left out: {shift}")
            continue
        for name in wanted:
            values = _carry(samples, other, name, shift)
            if values is None:
                what = BY_COLUMN[name].name if name in BY_COLUMN else name
                notes.append(f"{what} left out: holes in {other.name or 'its table'}")
                continue
            columns[name] = values
            estimated = estimated or (name == "heading_deg" and other.estimated)
        notes.extend(note for note in other.notes if note not in notes)
    if new := {name: columns.pop(name) for name in list(columns) if name not in AUXILIARY}:
        columns["disturbers"] = {**samples.disturbers, **new}
    return samples.with_columns(**columns, notes=tuple(notes), heading_estimated=estimated)


def _find_shift(samples: Samples, other: Beside) -> float | str:
    """Seconds from the other's clock to that of the samples, or why they do not meet."""
    if samples.time is None or other.time is None:
        alike = samples.time is None and other.time is None and other.rows == len(samples)
        return 0.0 if alike else "its rows and those of the magnetometer have no common times"
    if (samples.epoch is None) != (other.epoch is None):
        return "only one of the two clocks tells the date"
    if samples.epoch is None or other.epoch is None:
        return 0.0
    return (other.epoch - samples.epoch).total_seconds()


def _carry(samples: Samples, other: Beside, name: str, shift: float) -> Array | None:
    """A column of another table at the readings; `None` where more than a few have none near."""
    values = other.columns[name]
    if samples.time is None or other.time is None:
        return values
    known = np.isfinite(other.time) & np.isfinite(values.reshape(len(values), -1)).all(axis=1)
    if not known.any():
        return None
    time = other.time[known] + shift
    in_a_hole = measure_reach(time, samples.time) > find_reach(name, time)
    if np.mean(in_a_hole) > 0.01:  # of the readings
        return None
    return resample(time, values[known], samples.time, period=PERIODS_DEG.get(name))


class Found(NamedTuple):
    """What a file holds: its tables by their names, one alone under "", numbers for those that have
    none; what to say of it, and of the readings of a table, and how those had been corrected before
    they were written; and what else it holds. Where `parts` are of one log, a lone magnetometer is
    not called as its table is."""

    tables: Mapping[str, Table] | Mapping[int, Table]
    about: About
    corrected: Mapping[str, str] = {}
    remarks: Mapping[str, tuple[str, ...]] = {}
    streams: tuple[Stream, ...] = ()
    parts: bool = False


def read_file(kind: Format, path: Path, source: Input, unit: str | None) -> Log:
    """The log that a file of a kind is."""
    if hasattr(kind.reader, "read"):
        log: Log = kind.reader.read(path, source, *(() if kind.unit_fixed else (unit,)))
        return log
    return build_tables_log(kind.reader.read_tables(path), path, source, unit)


def build_tables_log(found: Found, path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that the tables of a file are; that of one alone, its sensors apart where it is a
    long one. `unit` is that of the field where no header names one."""
    facts = Facts(path=path, source=source, unit=unit, **found.about)
    alone = len(found.tables) == 1
    if {*found.tables} != {""}:
        tables: dict[Any, Table] = {
            name: name_axes(table, name, alone=alone) if isinstance(name, str) else table
            for name, table in found.tables.items()
        }
        paths = {name: Path(name) for name in tables if isinstance(name, str)}
        fields = [name for name, table in tables.items() if "field" in identify_columns(table)]
        if found.parts and len(fields) == 1:
            tables[""], paths[""] = tables.pop(fields[0]), Path(fields[0])
        corrected = {**found.corrected, "": found.corrected.get(fields[0], "") if fields else ""}
        log = build_groups_log(tables, paths, found.remarks, corrected, **facts)
    else:
        (table,) = found.tables.values()
        parts = split_by_sensor(table)
        named = {name: Path(name) for name in parts or ()}
        log = build_groups_log(parts, named, **facts) if parts else build_log(table, **facts)
        log = _mark_corrected(log, found.corrected.get("", ""))
    return replace(log, streams=(*log.streams, *found.streams))


def _mark_corrected(log: Log, how: str) -> Log:
    """The log whose readings had been corrected before they were written, where it says `how`."""
    if not how:
        return log
    sensors = (one.with_columns(corrected=True, notes=(*one.notes, how)) for one in log.sensors)
    return replace(log, sensors=tuple(sensors))


def name_label(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """The headers, with "sensor" for a column whose cells name a magnetometer and another sensor,
    whatever it is called: rows of both must not become one sensor's."""
    names = list(headers)
    if "sensor" in find_quantities(names).values():
        return names
    for at, name in enumerate(names):
        if identify_column(name) is not None:
            continue
        cells = {row[at].strip() for row in rows if at < len(row)}
        if len(cells) > MOST_PARTS or not any(cell[:1].isalpha() for cell in cells):
            continue
        named = {find_named_quantity(cell) for cell in cells if cell}
        if "field" in named and named & INERTIAL.keys():
            return [*names[:at], "sensor", *names[at + 1 :]]
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
