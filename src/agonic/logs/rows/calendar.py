"""Moments whose year, month, day, hour, minute and second stand in columns of their own, or that
GPS counts: the week since 1980-01-06, and the time of the week. UTC is behind GPS by the leap
seconds since then: UTC = GPS − (TAI − UTC − 19 s). Source: IS-GPS-200, sections 3.3.4 and
20.3.3.5.2.4.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.logs.clocks.clock import NO_ZONE, TIMES_OF_DAY, Clock, since_first_second, unwrap
from agonic.logs.headers.columns import Identified
from agonic.logs.headers.header import Column
from agonic.logs.headers.quantities import PARTS
from agonic.logs.log import Table
from agonic.logs.rows.auxiliary import to_numbers
from agonic.units import DAY_S

GPS_EPOCH = datetime(1980, 1, 6, tzinfo=UTC)
_GPS_UNIX_S = GPS_EPOCH.timestamp()
_WEEK_S = 7 * DAY_S


def find_gps_clock(table: Table, found: Identified) -> Clock:
    """The clock that the columns of week and time of week are; without a week it has no date."""
    tow, week = (_pick(found, name) for name in ("gps_tow", "gps_week"))
    seconds, notes = _read_week_s(table, tow) if tow else (None, ())
    if seconds is None:
        return None, None, notes
    said = "times of the GPS week, without a date"
    if week is not None:
        weeks = to_numbers(table[week.header])
        weeks = np.where(weeks > 0, weeks, np.nan)
        if not (weeks[np.isfinite(weeks)] < 1024).any():
            gps = weeks * _WEEK_S + seconds + _GPS_UNIX_S
            known = gps[np.isfinite(gps)]
            behind = gps_utc_s(known[0]) if len(known) else 0.0
            return since_first_second(gps - behind, notes)
        said = f"date left out: {week.header} counts from a rollover, 1024 weeks on"
    return unwrap(seconds, _WEEK_S), None, (*notes, said)


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


def _read_week_s(table: Table, column: Column) -> tuple[Array | None, tuple[str, ...]]:
    """Seconds of the week; `None` where their unit is neither told nor seen, and a note."""
    values = to_numbers(table[column.header])
    known = values[np.isfinite(values)]
    if column.unit:
        per_second = 1 / column.quantity.units[column.unit][0]
    elif not len(known):
        return None, ()
    elif column.header.strip().lower().endswith(("itow", "gms", "ms")):  # of u-blox, ArduPilot
        per_second = 1e3
    else:
        per_second = next((p for p in (1.0, 1e3, 1e6, 1e9) if known.max() <= _WEEK_S * p), 0.0)
        step = float(np.median(np.abs(np.diff(known)))) if len(known) > 1 else 0.0
        if not per_second or (per_second == 1.0 and step >= 5.0):
            unknown = f"times left out: {column.header} has no unit; name it tow_s or tow_ms"
            return None, (unknown,)
    return values / per_second, ()


def gps_utc_s(unix_s: float) -> float:
    """GPS − UTC, s, at a moment."""
    from agonic.maths.earth.earth_rotation import tai_utc_s

    return float(tai_utc_s([unix_s])[0]) - 19.0


def read_parts(table: Table, found: Identified) -> Clock:
    """The clock that columns of hours, minutes and seconds are, with the date beside them."""
    parts = _take_parts(table, found)
    if "hour" not in parts or "minute" not in parts:
        return None, None, ()
    hour, minute = parts["hour"], parts["minute"]
    seconds = 3600.0 * hour + 60.0 * minute
    seconds += parts.get("second_of_minute", 0.0) + parts.get("millisecond", 0.0) * 1e-3
    seconds[~((hour >= 0) & (hour <= 24) & (minute >= 0) & (minute < 60))] = np.nan
    days = _count_days(parts)
    if days is not None:
        return since_first_second(days * DAY_S + seconds, (NO_ZONE,))
    return unwrap(seconds, DAY_S), None, (f"{TIMES_OF_DAY} without a date",)


def _take_parts(table: Table, found: Identified) -> dict[str, Any]:
    """The columns of parts of a moment, (n,) each, by their names."""
    alone = {part: groups.get("", {}).get("") for part, groups in found.items()}
    columns = {part: c for part, c in alone.items() if c is not None and part in PARTS}
    return {part: to_numbers(table[c.header]).astype(np.float64) for part, c in columns.items()}


def _count_days(parts: Mapping[str, Any]) -> Array | None:
    """Days since 1970 by year and month and day, or day of the year; NaN where none."""
    calendar = {"month", "day_of_month"} <= parts.keys()
    if "year" not in parts or not (calendar or "day_of_year" in parts):
        return None
    year = np.where(parts["year"] < 100, parts["year"] + 2000.0, parts["year"])
    if calendar:
        month, day = parts["month"], parts["day_of_month"]
        known = (month >= 1) & (month <= 12) & (day >= 1) & (day < 32)
    else:
        month, day = np.ones(len(year)), parts["day_of_year"]
        known = (day >= 1) & (day < 367)
    known &= (year >= 1900) & (year < 2200)
    whole = np.where(known, year, 1970.0).astype(int) - 1970
    months = 12 * whole + np.where(known, month, 1.0).astype(int) - 1
    first: NDArray[np.datetime64] = months.astype("datetime64[M]").astype("datetime64[D]")
    return np.where(known, first.astype(float) + day - 1.0, np.nan)


def write_days(table: Table, found: Identified) -> NDArray[np.str_] | None:
    """The dates of the rows, where columns of year, month and day tell them; `None` where not."""
    days = _count_days(_take_parts(table, found))
    if days is None:
        return None
    whole = np.where(np.isfinite(days), days, 0.0).astype(int).astype("datetime64[D]")
    return np.where(np.isfinite(days), np.datetime_as_string(whole), "")
