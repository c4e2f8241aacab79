"""The times of the rows of a table: which column is the clock of which magnetometer."""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Mask
from agonic.logs.clocks.clock import NO_ZONE, TIMES_OF_DAY, UNIX, Clock, read_clock, spread_ties
from agonic.logs.headers.columns import FRACTION, Identified
from agonic.logs.headers.header import Column
from agonic.logs.headers.quantities import ZONE
from agonic.logs.log import Table
from agonic.logs.rows.auxiliary import LONGEST_LOG_S, find_misplaced, to_numbers
from agonic.maths.one_pass import median

_CLOCK_SHARE = 0.9
"""Share of rows that must have a time, for the others to be given up rather than the clock."""
_TICKS = "1e-4s"
"""The unit of SampleTimeFine of Xsens MT, which sends once a second at least; DOT counts 1 µs."""
_SCALED = re.compile(r"[(\[{]\s*[x×*/]?\s*\d[\d.eE+-]*\s*[x×*/]?\s*[nuµμm]?s(?:ec)?\s*[)\]}]\s*$")
"""A factor before a unit of time: [10us], (x0.1 s)."""
Groups = Mapping[str, Mapping[str, Column]]


def pick(groups: Groups, number: str) -> Mapping[str, Column]:
    """The columns of the sensor of that number or name, else those without one. A magnetometer that
    is not numbered takes the only ones there are."""
    only = next(iter(groups.values())) if len(groups) == 1 and not number.isdecimal() else {}
    return groups.get(number) or groups.get("") or only


def find_clocks(table: Table, found: Identified, fields: list[str]) -> dict[str, Clock]:
    """The clock of all rows for each magnetometer, by its number."""
    clocks: dict[str, Clock] = {}
    known: dict[str, Clock] = {}
    for number in fields:
        time = _pick_time(table, found, number)
        header = time[""].header if "" in time else ""
        if header not in known:
            known[header] = _find_clock(table, found, time)
            own = known[header][0]
            if own is not None and own is not table.get(header):
                own.flags.writeable = False  # `Samples` need not copy it
        clocks[number] = known[header]
    return clocks


def _pick_time(table: Table, found: Identified, number: str) -> Mapping[str, Column]:
    """The time columns for a magnetometer; of other sensors' only those that its rows have."""
    groups = found.get("time", {})
    if time := pick(groups, number):
        return _join_fraction(table, time, groups)
    axes = found.get("field", {}).get(number)
    if axes is None:
        return next(iter(groups.values())) if len(groups) == 1 else {}
    rows = np.isfinite(to_numbers(table[axes["x"].header]))
    for time in groups.values():
        values = table[time[""].header]
        if values.dtype.kind == "f" and np.isfinite(values[rows]).mean() >= _CLOCK_SHARE:
            return time
    return {}


def _join_fraction(
    table: Table, time: Mapping[str, Column], groups: Groups
) -> Mapping[str, Column]:
    """The columns of a clock in whole seconds, where the only one counts anew within each."""
    part = time.get("")
    others = [group[""] for group in groups.values() if "" in group and group[""] is not part]
    if part is None or part.unit is None or FRACTION in time or len(others) != 1:
        return time
    seconds = to_numbers(table[part.header]) * part.quantity.units[part.unit][0]
    known = seconds[np.isfinite(seconds)]
    begins_anew = len(known) > 0 and 0 <= known.min() <= known.max() < 1 and leads_back(known)
    return {"": others[0], FRACTION: part} if begins_anew else time


def _find_clock(table: Table, found: Identified, group: Mapping[str, Column]) -> Clock:
    """The clock of all rows, from the time column, with a date column or an epoch if there is."""
    if pick(found.get("gps_tow", {}), ""):
        from agonic.logs.rows.calendar import date_by_gps, find_gps_clock

        if "" not in group:
            return find_gps_clock(table, found)
        rest = {name: groups for name, groups in found.items() if name != "gps_tow"}
        return date_by_gps(_find_clock(table, rest, group), table, found)
    time, date = (axes.get("") for axes in (group, pick(found.get("date", {}), "")))
    if time is None and date is None and "hour" in found:
        from agonic.logs.rows.calendar import read_parts

        return read_parts(table, found)
    if time is None:
        return read_clock(table[date.header], None) if date else (None, None, ())
    clock = _read_column(table, found, group)
    zone = ZONE.search(time.header)
    if zone is None or clock[1] is None or NO_ZONE not in clock[2]:
        return clock
    ahead = timedelta(hours=int(zone[2]), minutes=int(zone[3] or 0))
    return clock[0], clock[1] + (ahead if zone[1] == "-" else -ahead), ()


def _read_column(table: Table, found: Identified, group: Mapping[str, Column]) -> Clock:
    """The clock in a time column, with a finer one or the epoch beside it."""
    time, part = group[""], group.get(FRACTION)
    values = table[time.header]
    factor = time.quantity.units[time.unit][0] if time.unit else None
    if time.unit is None and values.dtype.kind in "fiu" and _SCALED.search(time.header):
        why = f"times left out: the unit in {time.header!r} is not known; write seconds as time_s"
        return None, None, (why,)
    if time.unit == _TICKS:
        steps = np.diff((numbers := to_numbers(values))[np.isfinite(numbers)])
        if len(steps) and (step := median(steps)) > 1e4:
            said = f"{time.header} steps by {step:g}: microseconds, as Xsens DOT counts"
            return *read_clock(values, 1e-6)[:2], (said,)
    if part is not None:  # which a float of Unix nanoseconds would round
        begun, epoch, notes = _read_column(table, found, {"": time})
        if begun is None:
            return _read_column(table, found, {"": part})
        seconds = to_numbers(table[part.header]) * part.quantity.units[part.unit or "s"][0]
        both = np.isfinite(begun) & np.isfinite(seconds)
        if ((begun[both] % 1 == 0) & (seconds[both] >= 0) & (seconds[both] < 1)).all():
            return begun + seconds, epoch, notes
        return begun, epoch, (*notes, f"{part.header[:30]} is another clock: left out")
    start = pick(found.get("epoch", {}), "").get("")
    if start is not None and values.dtype.kind in "fiu":
        moment = to_numbers(table[start.header])
        moment = moment[np.isfinite(moment)]
        known = moment[(moment >= 0) & (moment < 2.5e11)]  # year 9999, the last of Python's dates
        if len(moment):
            epoch = UNIX + timedelta(seconds=float(known[0])) if len(known) else None
            said = f"{start.header} left out: {moment[0]:g} is no date"
            return to_numbers(values) * (factor or 1.0), epoch, () if len(known) else (said,)
    clock = _date_clock(table, found, values, factor)
    if not time.documented:
        return clock
    return *clock[:2], (*clock[2], f"times in units of {factor:g} s, as {time.documented} says")


def _date_clock(
    table: Table, found: Identified, values: NDArray[Any], factor: float | None
) -> Clock:
    """The clock in a time column, with the date in another or in columns of its parts."""
    date = pick(found.get("date", {}), "").get("")
    days = table[date.header] if date is not None else None
    if days is None and "year" in found:
        from agonic.logs.rows.calendar import write_days

        days = write_days(table, found)
    clock: Clock = None, None, ()
    if days is not None and values.dtype.kind in "OUS":
        moments = [f"{day} {of_day}" for day, of_day in zip(days, values, strict=True)]
        clock = read_clock(np.array(moments), factor)
    if clock[0] is None:  # the time may hold the date too
        clock = read_clock(values, factor)
    if date is None:
        return clock
    if clock[0] is None and table[date.header].dtype.kind in "OUS":
        by_date = read_clock(table[date.header], None)
        clock = by_date if by_date[0] is not None and np.ptp(by_date[0]) > 0 else clock
    if any(note.startswith(TIMES_OF_DAY) for note in clock[2]):  # with the date of the first row
        _, day, notes = read_clock(table[date.header][:1], None)
        clock = clock[0], day, notes if day is not None else clock[2]
    return clock


def leads_back(time: Array) -> bool:
    """Whether a time is earlier than the one before it."""
    return not increases(time) and bool((np.diff(time[np.isfinite(time)]) < 0).any())


def increases(time: Array) -> bool:
    """Whether all times are finite and each is later than the one before it."""
    return bool(np.isfinite(time[:1]).all() and np.isfinite(time[-1:]).all()) and bool(
        (time[1:] > time[:-1]).all()
    )


def find_time(
    clock: Clock, field: Array, readings: Mask
) -> tuple[Array | None, datetime | None, tuple[str, ...]]:
    """The times of a clock, single wrong ones marked and a coarse clock spread. `field` (n, 3) is
    what was read at them, `readings` (n,) marks the rows that hold one."""
    time, epoch, notes = clock
    if time is None:
        return None, None, notes
    if increases(time) and not time[-1] - time[0] > LONGEST_LOG_S:
        return time, epoch, notes
    time = np.where(find_misplaced(time), np.nan, time)
    restarts: tuple[str, ...] = ()
    if leads_back(time):
        from agonic.logs.rows.order import continue_time, find_strays

        time = np.where(find_strays(time), np.nan, time)
        time, restarts = continue_time(time, field)
    known = time[np.isfinite(time) & readings]
    if len(known) < _CLOCK_SHARE * readings.sum() or (len(known) > 1 and np.ptp(known) == 0):
        return None, None, (*notes, "times left out: the clock stands still or is mostly missing")
    time, remarks = spread_ties(time, field)
    return time, epoch, (*notes, *restarts, *remarks)
