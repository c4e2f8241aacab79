"""Moments whose year, month, day, hour, minute and second stand in columns of their own."""

from __future__ import annotations

import re
from datetime import timedelta

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.logs.clocks.clock import NO_ZONE, TIMES_OF_DAY, Clock, since_first_second
from agonic.logs.headers.columns import Identified
from agonic.logs.rows.auxiliary import Table, to_numbers
from agonic.units import DAY_S

_CENTURY = 2000.0


def read_parts(table: Table, found: Identified) -> Clock:
    """The clock that columns of hours, minutes and seconds are, with the date beside them if any.

    >>> import numpy as np
    >>> from agonic.logs.headers.columns import identify_columns
    >>> table = {"hour": np.array([23.0, 0]), "minute": np.array([59.0, 0])}
    >>> read_parts(table, identify_columns(table))[0].tolist()
    [86340.0, 86400.0]
    """
    hour, minute = _get(table, found, "hour"), _get(table, found, "minute")
    if hour is None or minute is None:
        return None, None, ()
    second, part = _get(table, found, "second_of_minute"), _get(table, found, "millisecond")
    seconds = 3600.0 * hour + 60.0 * minute
    seconds += (0.0 if second is None else second) + (0.0 if part is None else part * 1e-3)
    seconds[~((hour >= 0) & (hour <= 24) & (minute >= 0) & (minute < 60))] = np.nan
    days = _count_days(table, found)
    if days is not None:
        return since_first_second(days * DAY_S + seconds, (NO_ZONE,))
    known = np.isfinite(seconds)
    seconds[known] = np.unwrap(seconds[known], period=DAY_S)
    return seconds, None, (f"{TIMES_OF_DAY} without a date",)


def _count_days(table: Table, found: Identified) -> Array | None:
    """Days since 1970 by columns of year and month and day, or day of the year; NaN where none."""
    year, month = _get(table, found, "year"), _get(table, found, "month")
    day, of_year = _get(table, found, "day_of_month"), _get(table, found, "day_of_year")
    if year is None or not ((month is not None and day is not None) or of_year is not None):
        return None
    year = np.where(year < 100, year + _CENTURY, year)
    if month is None or day is None:
        month, day = np.ones(len(year)), np.asarray(of_year)
        known = (day >= 1) & (day < 367)
    else:
        known = (month >= 1) & (month <= 12) & (day >= 1) & (day < 32)
    known &= (year >= 1900) & (year < 2200)
    whole = np.where(known, year, 1970.0).astype(int) - 1970
    months = 12 * whole + np.where(known, month, 1.0).astype(int) - 1
    first: NDArray[np.datetime64] = months.astype("datetime64[M]").astype("datetime64[D]")
    return np.where(known, first.astype(float) + day - 1.0, np.nan)


def write_days(table: Table, found: Identified) -> NDArray[np.str_] | None:
    """The dates of the rows, where columns of year, month and day tell them; `None` where not."""
    days = _count_days(table, found)
    if days is None:
        return None
    whole = np.where(np.isfinite(days), days, 0.0).astype(int).astype("datetime64[D]")
    return np.where(np.isfinite(days), np.datetime_as_string(whole), "")


def _get(table: Table, found: Identified, part: str) -> Array | None:
    column = found.get(part, {}).get("", {}).get("")
    return None if column is None else to_numbers(table[column.header]).astype(np.float64)


def read_zone(match: re.Match[str]) -> timedelta:
    """How far a zone that a header names is ahead of UTC.

    >>> from agonic.logs.headers.words import ZONE
    >>> read_zone(ZONE.search("Date Time, GMT+03:00")).total_seconds() / 3600
    3.0
    """
    ahead = timedelta(hours=int(match[2]), minutes=int(match[3] or 0))
    return -ahead if match[1] == "-" else ahead
