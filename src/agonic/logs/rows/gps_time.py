"""Times as GPS counts them: the week since 1980-01-06, and the time of the week.

UTC is behind by the leap seconds since then: UTC = GPS − (TAI − UTC − 19 s). Source: IS-GPS-200,
sections 3.3.4 and 20.3.3.5.2.4.
"""

from __future__ import annotations

from datetime import timedelta

import numpy as np

from agonic.arrays import Array
from agonic.logs.clocks.clock import UNIX, Clock
from agonic.logs.headers.columns import Column, Identified
from agonic.logs.rows.auxiliary import Table, to_numbers

_GPS_UNIX_S = 315_964_800.0
_WEEK_S = 604_800.0
_GPS_TAI_S = 19.0
_ROLLOVER = 1024.0
_PER_SECOND = (1.0, 1e3, 1e6, 1e9)
_IN_MS = ("itow", "gms", "ms")
"""How names end that are always in milliseconds (u-blox, ArduPilot)."""
_WHOLE_STEP = 5.0


def find_gps_clock(table: Table, found: Identified) -> Clock:
    """The clock that the columns of week and time of week are; without a week it has no date."""
    seconds, notes = _read_week_s(table, _pick(found, "gps_tow"))
    if seconds is None:
        return None, None, notes
    weeks, told = _read_weeks(table, found)
    if weeks is None:
        known = np.isfinite(seconds)
        seconds[known] = np.unwrap(seconds[known], period=_WEEK_S)
        return seconds, None, (*notes, *told)
    unix = _to_utc_s(weeks * _WEEK_S + seconds)
    first = unix[np.isfinite(unix)]
    if not len(first):
        return None, None, ("times left out: no GPS time could be read",)
    start = float(np.floor(min(first[0], first[-1])))
    return unix - start, UNIX + timedelta(seconds=start), notes


def date_by_gps(clock: Clock, table: Table, found: Identified) -> Clock:
    """A clock, with the date that columns of GPS time give it where it has none."""
    time, epoch, notes = clock
    gps, day, _ = find_gps_clock(table, found)
    if time is None:
        return (gps, day, notes) if gps is not None else clock
    if epoch is not None or gps is None or day is None:
        return clock
    apart = gps - time
    apart = apart[np.isfinite(apart)]
    if not len(apart):
        return clock
    return time, day + timedelta(seconds=float(np.median(apart))), (*notes, "date by GPS time")


def _pick(found: Identified, name: str) -> Column | None:
    groups = found.get(name, {})
    axes = groups.get("") or next(iter(groups.values()), {})
    return axes.get("")


def _read_week_s(table: Table, column: Column | None) -> tuple[Array | None, tuple[str, ...]]:
    """Seconds of the week; `None` where their unit is neither told nor seen, and a note."""
    if column is None:
        return None, ()
    values = to_numbers(table[column.header])
    known = values[np.isfinite(values)]
    if column.unit:
        per_second = 1 / column.quantity.units[column.unit][0]
    elif not len(known):
        return None, ()
    elif column.header.strip().lower().endswith(_IN_MS):
        per_second = 1e3
    else:
        per_second = next((p for p in _PER_SECOND if known.max() <= _WEEK_S * p), 0.0)
        step = float(np.median(np.abs(np.diff(known)))) if len(known) > 1 else 0.0
        if not per_second or (per_second == 1.0 and step >= _WHOLE_STEP):
            unknown = f"times left out: {column.header} has no unit; name it tow_s or tow_ms"
            return None, (unknown,)
    return values / per_second, ()


def _read_weeks(table: Table, found: Identified) -> tuple[Array | None, tuple[str, ...]]:
    """The GPS weeks, NaN where there was no fix; `None` where they give no date."""
    column = _pick(found, "gps_week")
    if column is None:
        return None, ("times of the GPS week, without a date",)
    weeks = to_numbers(table[column.header])
    weeks = np.where(weeks > 0, weeks, np.nan)
    if (weeks[np.isfinite(weeks)] < _ROLLOVER).any():
        return None, (f"date left out: {column.header} counts from a rollover, 1024 weeks on",)
    return weeks, ()


def _to_utc_s(gps: Array) -> Array:
    """Unix seconds of GPS seconds since 1980, by the leap seconds at the first of them."""
    from agonic.maths.earth.earth_rotation import tai_utc_s

    known = gps[np.isfinite(gps)]
    if not len(known):
        return gps
    leap = float(tai_utc_s(known[:1] + _GPS_UNIX_S)[0]) - _GPS_TAI_S
    return gps + _GPS_UNIX_S - leap
