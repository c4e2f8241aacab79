"""Tables with clocks of their own, as bags, structures and tagged lines hold them, into one log.

Each table with a magnetometer gives its sensors; what they lack is taken from the other tables,
interpolated at their readings. A column is not carried over holes: where more than a few readings
have no row of the other table near them, it is left out, and a note says so.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.headers.columns import identify_columns
from agonic.logs.headers.conventions import apply_conventions
from agonic.logs.headers.quantities import BY_COLUMN
from agonic.logs.log import Log, Stream
from agonic.logs.rows.auxiliary import PERIODS_DEG, Table, find_reach, measure_reach, set_angle_unit
from agonic.logs.rows.beside import AUXILIARY, Part, read_columns, read_disturbers
from agonic.logs.rows.resample import compute_rate_Hz, resample
from agonic.logs.rows.times import find_clocks, find_time
from agonic.logs.table import build_log, refuse_no_magnetometer
from agonic.provenance import Input
from agonic.samples import Samples

_FEW = 0.01
"""Share of the readings that may lie in a hole of another table."""


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


def build_groups_log(
    groups: Mapping[str, Table] | Mapping[int, Table],
    *,
    path: Path,
    source: Input,
    format: str,
    unit: str | None = None,
    others: Iterable[str] = (),
    notes: tuple[str, ...] = (),
    remarks: tuple[str, ...] = (),
    paths: Mapping[str, Path] | None = None,
) -> Log:
    """The log that tables are, by the name of each, or a number where they have none.

    `paths` are files of the tables, where they have their own. The rest as for `build_log`.

    Raises `LogError` where none of them holds a magnetometer.
    """
    logs, beside, failures = [], [], []
    for key, table in groups.items():
        name = key if isinstance(key, str) else ""
        if not table:
            continue
        own = (paths or {}).get(name, path)
        try:
            if not any(
                len(axes) == 3 for axes in identify_columns(table).get("field", {}).values()
            ):
                beside.append(read_beside(name, table, own))
                continue
            log = build_log(
                table, path=own, source=source, format=format, unit=unit, remarks=remarks
            )
        except LogError as error:
            failures.append(f"{name or 'a table'}: {error}")
            continue
        logs.append((name, log))
    if not logs:
        if failures:
            raise LogError("; ".join(failures[:3]))
        refuse_no_magnetometer([header for table in groups.values() for header in table], others)
    sensors = [
        _complete(_rename(samples, group, len(log.sensors)), group, beside)
        for group, log in logs
        for samples in log.sensors
    ]
    return Log(
        path=path,
        format=format,
        source=source,
        sensors=tuple(_with_own_names(sensors)),
        streams=(*(s for _, log in logs for s in log.streams), *_list_streams(beside, others)),
        notes=(*notes, *(note for _, log in logs for note in log.notes), *failures),
    )


def read_beside(name: str, table: Table, path: Path) -> Beside:
    """The columns of a table without a magnetometer; those of its first sensor."""
    found, documented = apply_conventions(identify_columns(table), table, path.stem)
    found = set_angle_unit(found, table)
    rows = len(next(iter(table.values())))
    numbers = list(dict.fromkeys(n for q, groups in found.items() if q != "time" for n in groups))
    number = numbers[0] if numbers else ""
    part = Part(
        table=table, found=found, rows=None, clocks=find_clocks(table, found, [number]), unit=None,
        source=Input(name=name, sha256="", count=rows), remarks=(),
    )  # fmt: skip
    every = np.ones(rows, dtype=bool)
    time, epoch, notes = find_time(part.clock(number), np.zeros((rows, 3)), every)
    columns, estimated, remarks = read_columns(part, number, time, ~every)
    disturbers, told = read_disturbers(part, time, ~every)
    return Beside(
        name=name,
        time=time,
        epoch=epoch,
        columns={n: values for n, values in columns.items() if values is not None} | disturbers,
        rows=rows,
        estimated=estimated,
        notes=(*documented, *(note for note in notes if time is None), *remarks, *told),
    )


def _complete(samples: Samples, group: str, beside: Iterable[Beside]) -> Samples:
    """The samples with the columns that they lack, of the tables named nearest to theirs first."""
    nearest = sorted(beside, key=lambda other: -_count_common(group, other.name))
    columns: dict[str, Any] = {}
    notes = list(samples.notes)
    estimated = samples.heading_estimated
    for other in nearest:
        have = samples.columns().keys() | columns.keys()
        wanted = sorted(other.columns.keys() - have, key=list(other.columns).index)
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
    return samples.with_columns(
        **columns,
        notes=tuple(notes),
        heading_estimated=estimated,
    )


def _count_common(one: str, other: str) -> int:
    """How many letters two names begin with in common."""
    differ = (k for k, (a, b) in enumerate(zip(one, other, strict=False)) if a != b)
    return next(differ, min(len(one), len(other)))


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
    if np.mean(measure_reach(time, samples.time) > find_reach(name, time)) > _FEW:
        return None
    return resample(time, values[known], samples.time, period=PERIODS_DEG.get(name))


def _rename(samples: Samples, group: str, count: int) -> Samples:
    """A sensor named by the group that it is in, if that has a name."""
    if not group:
        return samples
    alone = count == 1 and samples.name == "mag"
    return samples.with_columns(name=group if alone else f"{group} {samples.name}")


def _with_own_names(sensors: Iterable[Samples]) -> list[Samples]:
    """The sensors, numbered where two have one name."""
    known: dict[str, int] = {}
    named = []
    for samples in sensors:
        known[samples.name] = known.get(samples.name, 0) + 1
        times = known[samples.name]
        numbered = f"{samples.name} #{times}"
        named.append(samples if times == 1 else samples.with_columns(name=numbered))
    return named


def _list_streams(beside: Iterable[Beside], others: Iterable[str]) -> list[Stream]:
    """The tables without a magnetometer, and what was not read."""
    tables = [
        Stream(
            name=other.name,
            rows=other.rows,
            rate_Hz=None if other.time is None else compute_rate_Hz(other.time),
        )
        for other in beside
        if other.name
    ]
    return [*tables, *(Stream(name=name, rows=0) for name in others)]
