"""A table of named columns, made into a `Samples` for each magnetometer in it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import NoReturn, Unpack

import numpy as np

from agonic.arrays import Index
from agonic.errors import LogError, TwoAxisError
from agonic.logs.contents import MOST_PARTS
from agonic.logs.formats import name_own_table
from agonic.logs.headers.column_names import suggest_names
from agonic.logs.headers.columns import (
    CORRECTED,
    OF_DEVICE,
    OFFSETS,
    Identified,
    apply_conventions,
    find_doubtful,
    find_quantities,
    find_rivals,
    identify_columns,
    is_corrected,
)
from agonic.logs.headers.header import LONGEST, name_quantity
from agonic.logs.headers.quantities import FALLBACK, LAST
from agonic.logs.log import TORN, Facts, Log, Stream, Table, are_two_axes_allowed
from agonic.logs.rows import auxiliary
from agonic.logs.rows.other_columns import Part, find_foreign_rows, read_columns, read_disturbers
from agonic.logs.rows.times import find_clocks, find_time, leads_back, pick
from agonic.samples import Samples
from agonic.units import nanotesla_per

_CLOCKS = frozenset(("time", "date", "hour", "gps_tow"))
_MAGNITUDE = re.compile(
    r"(?:mag(?:\d|_?field)?|tmi|tmf|total_?field|b_?total|scalar_?\w*)[\s_]*[(\[]?(?:nt)?[)\]]?",
    re.IGNORECASE,
)
TWO_AXES = "a two-axis compass, x and y alone, is calibrated with agonic calibrate"


def build_log(table: Table, **facts: Unpack[Facts]) -> Log:
    """The log that a table is: its magnetometers with their columns, and what else it holds."""
    others, notes = tuple(facts.get("others", ())), facts.get("notes", ())
    headers = [*table, *others]
    if "field" not in find_quantities(table).values():
        refuse_no_magnetometer(table, others)
    found = identify_columns(table)
    axes = found.get("field", {})
    fields = [number for number in axes if len(axes[number]) == 3]
    if not fields and are_two_axes_allowed():
        fields = [number for number in axes if set(axes[number]) == set("xy")]
    if not fields:
        refuse_no_magnetometer(table, others)
    fields.sort(key=lambda number: is_corrected(axes[number]))  # the raw one is first
    found, documented = apply_conventions(
        auxiliary.state_unit(found, table), headers, facts["path"].stem
    )
    found = auxiliary.set_angle_unit(found, table)
    whole = Part(
        table=table,
        found=found,
        rows=None,
        clocks=find_clocks(table, found, fields),
        unit=facts.get("unit"),
        source=facts["source"],
        remarks=(
            *facts.get("remarks", ()),
            *documented,
            *((CORRECTED,) if OFFSETS.issubset(headers) else ()),
            *_note_choices(found, table, others, fields),
        ),
    )
    sensors, failures = _read_sensors(whole, fields)
    if TORN in notes:
        sensors = [one.with_columns(rejected={**one.rejected, TORN: 1}) for one in sensors]
    groups = [axes for by_sensor in found.values() for axes in by_sensor.values()]
    used = {column.header for axes in groups for column in axes.values()}
    rows = len(next(iter(table.values())))
    unused = (header[:LONGEST] for header in (*(h for h in table if h not in used), *others))
    streams = (Stream.at(header, rows, sensors[0].time) for header in unused)
    return Log.of(facts, sensors, streams, failures)


def _note_choices(
    found: Identified, table: Table, others: Sequence[str], fields: list[str]
) -> Iterator[str]:
    """What was taken where a table holds a field twice, no clock that is known, or several columns
    of one quantity; and how to choose."""
    for number in fields:
        axes = found["field"][number]
        if rivals := find_rivals([*table, *others], axes):
            taken = ", ".join(axes[axis].header for axis in "xyz" if axis in axes)
            given = ",".join(f"{axis}={header}" for axis, header in zip("xyz", rivals, strict=True))
            yield f"{taken} are taken; the table holds more fields: --columns {given}"
    free = [header[:30] for header in others if header.strip()]
    if free and not _CLOCKS.intersection(found):
        yield f"no column is known for a time ({', '.join(free[:5])}): --columns time=… names it"
    if doubtful := find_doubtful(table):
        yield f"{' and '.join(doubtful)} left out: choose one with --columns"


def _read_sensors(whole: Part, fields: list[str]) -> tuple[list[Samples], list[str]]:
    """The magnetometers that have usable readings, and what is wrong with the others."""
    sensors, failures = [], []
    for label, rows in _split_rows(whole):
        for number in fields:
            numbered = f"mag{number}" if number.isdecimal() or not number else number
            name = f"{label} {numbered if number else ''}".strip() if label else numbered
            try:
                sensors.append(_read_sensor(replace(whole, rows=rows), name, number))
            except LogError as error:
                failures.append(f"{name}: {error}")
    if not sensors:
        raise LogError("; ".join(failures[:3]) or "none of its sensors is a magnetometer")
    return sensors, failures


def _read_sensor(part: Part, name: str, number: str) -> Samples:
    """The samples of the magnetometer of that number, with the columns that go with it."""
    axes = part.found["field"][number]
    part, sorted_notes = _put_in_order(part, number)
    field = part.values(axes)
    if len(axes) == 2:
        field = np.column_stack([field, np.zeros(len(field))])
    unit, unit_notes = auxiliary.find_field_unit(axes, part.unit, field)
    readings = auxiliary.find_finite_rows(field)
    time, epoch, time_notes = find_time(part.clock(number), field, readings)
    columns, estimated, remarks = read_columns(part, number, time, readings)
    disturbers, beside = read_disturbers(part, time, readings)
    by_device = (OF_DEVICE.format(axes["x"].header),) if is_corrected(axes) else ()
    if len(foreign := find_foreign_rows(part, field, readings)):
        keep = np.setdiff1d(np.arange(len(field)), foreign)
        field, time = field[keep], None if time is None else time[keep]
        columns = {n: None if c is None else c[keep] for n, c in columns.items()}
        disturbers = {n: c[keep] for n, c in disturbers.items()}
        remarks = (*remarks, f"{len(foreign)} rows are of other sensors")
    if columns.get("second") is not None:  # `Samples` takes it in the unit of the field
        columns["second"] = columns["second"] / nanotesla_per(unit)
    frame = pick(part.found.get("frame", {}), "").get("")
    letters = set() if frame is None else set(map(str, part.take(part.table[frame.header])))
    letter = letters.pop() if len(letters) == 1 else ""  # where all rows agree
    notes = (*by_device, *unit_notes, *time_notes, *sorted_notes, *remarks, *beside)
    samples = Samples(
        field=field,
        unit=unit,
        time=time,
        epoch=epoch,
        name=name,
        axes="".join(sorted(axes)),
        frame=letter if len(letter) == 1 and letter.isalpha() else "m",
        heading_estimated=estimated,
        corrected=CORRECTED in part.remarks or bool(by_device),
        disturbers=disturbers,
        notes=(*part.remarks, *notes),
        source=replace(part.source, count=len(field)),
        **columns,
    )
    return leave_out_date(samples)


def _put_in_order(part: Part, number: str) -> tuple[Part, tuple[str, ...]]:
    """The part with its rows in the order of their times, where that is easily done; and a note."""
    time, _, _ = part.clock(number)
    if time is None or not leads_back(time):
        return part, ()
    from agonic.logs.rows.order import order_rows

    order, notes = order_rows(time)
    if order is None:
        return part, notes
    return replace(part, rows=order if part.rows is None else part.rows[order]), notes


def _split_rows(whole: Part) -> Iterator[tuple[str, Index | None]]:
    """The rows of each sensor that a `sensor` column names, in order of appearance. A sensor whose
    own name says that it is an accelerometer or a gyroscope is left out. A column that may number
    anything names sensors where several rows have each number, and one that may also count the
    recordings, whose rows follow each other, only where they alternate."""
    column = pick(whole.found.get("sensor", {}), "").get("")
    if column is None:
        yield "", whole.rows
        return
    cells = whole.table[column.header]
    whole_numbers = (isinstance(cell, float) and cell.is_integer() for cell in cells)
    labels = [str(int(c) if w else c).strip() for c, w in zip(cells, whole_numbers, strict=True)]
    names, first, which = np.unique(np.array(labels), return_index=True, return_inverse=True)
    if column.rank >= FALLBACK:
        count = int(which.max()) + 1
        alternate = np.count_nonzero(np.diff(which)) > 2 * count
        if not 1 < count <= len(which) // 8 or (column.rank == LAST and not alternate):
            yield "", whole.rows
            return
    if len(names) > MOST_PARTS:
        raise LogError(f"{column.header!r} names {len(names)} sensors; is it another quantity?")
    for k in np.argsort(first):
        if len(names[k]) < 2 or name_quantity(f"{names[k]} x") in ("", "field"):
            yield str(names[k]), np.flatnonzero(which == k)


def refuse_no_magnetometer(headers: Iterable[str], others: Iterable[str]) -> NoReturn:
    """Raise `LogError` that says what there is instead of a magnetometer, and what is needed."""
    known = list(headers)
    every = [*known, *others]
    if own := name_own_table(every):
        raise LogError(f"this is {own}")
    if not every:
        raise LogError(
            "no columns of numbers found in it (tables and timetables of MATLAB are objects, which "
            "are not read): write it with writetable or writetimetable"
        )
    named = find_quantities(known)
    fields = identify_columns(h for h in known if named[h] == "field").get("field", {})
    parts = [c.header for axes in fields.values() for c in axes.values()]
    have = ", ".join(repr(h[:30]) for h in every[:10]) + (", …" if len(every) > 10 else "")
    alone = next((h for h in every if not parts and _MAGNITUDE.fullmatch(h.strip())), None)
    if alone is not None:
        raise LogError(
            f"no magnetometer columns found among {have}: {alone!r} is a magnitude alone, as a "
            "scalar magnetometer reads it; x, y and z are needed"
        )
    part = f"only {', '.join(parts[:4])} of x, y and z" if parts else "no magnetometer columns"
    sensors = {"acceleration": "an accelerometer", "rotation_rate": "a gyroscope"}
    other = next((said for name, said in sensors.items() if name in named.values()), "")
    beside = f" (of {other} only; if the magnetometer is in a file beside it, name the folder)"
    said = f"{part} found among {have}{beside if other and not parts else ''}; say which they are: "
    said += suggest_names(every)
    if any(set(axes) == set("xy") for axes in fields.values()):
        raise TwoAxisError(f"{said}; {TWO_AXES}")
    raise LogError(said)


def leave_out_date(samples: Samples) -> Samples:
    """The readings without their date, where it is the one that an unset clock has: within two days
    of 1970 (Unix) or of the first week of 1980 (memory cards, GPS). A log with positions keeps it:
    what tells the place tells the time as well."""
    if samples.epoch is None or samples.latitude_deg is not None or not len(samples):
        return samples
    seconds = 0.0 if samples.time is None else float(np.nan_to_num(samples.time[0]))
    begun = [datetime(*day, tzinfo=UTC) for day in ((1970, 1, 1), (1980, 1, 1), (1980, 1, 6))]
    since = [samples.epoch - beginning + timedelta(seconds=seconds) for beginning in begun]
    if not any(timedelta(0) <= ran < timedelta(days=2) for ran in since):
        return samples
    said = f"the clock was not set, it says {samples.epoch:%Y-%m-%d}: the log has no date"
    return samples.with_columns(epoch=None, notes=(*samples.notes, said))
