"""Numbers that are dates or times of day by their digits: 81530.25 for 08:15:30.25, days of Excel.

Taken as seconds they would run wrong without a word: after 81559 comes 81600.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.maths.one_pass import median
from agonic.units import DAY_S

_MINUTE, _HOUR = 100.0, 10_000.0
_FEWEST, _FEW = 3, 1000
_DAYS_OF_1970 = {
    "Excel": (25569.0, (36526.0, 49674.0)),
    "MATLAB": (719529.0, (730486.0, 743634.0)),
    "Modified Julian Dates": (40587.0, (51544.0, 64693.0)),
    "Julian Dates": (2440587.5, (2451544.5, 2464693.5)),
}
"""Day 1970-01-01 as these count days, and their days from 2000 to 2035."""
_LONGEST_STEP_DAYS = 1e-3
_CALENDAR = ((1.0, 2e13), (1e3, 2e16))
"""YYYYMMDDhhmmss, and the same with milliseconds."""


def read_digits_s(numbers: Array) -> tuple[Array, bool, str] | None:
    """Seconds of numbers that are calendar dates or times of day, whether since 1970, and a note.

    `None` where they are plain numbers. A time of day is told by its minutes: no number has more
    than 59 seconds, and from one minute to the next it leaps by 40 more than otherwise.

    >>> seconds, dated, _ = read_digits_s(np.array([81558.0, 81559.0, 81600.0, 81601.0]))
    >>> np.diff(seconds).tolist(), dated
    ([1.0, 1.0, 1.0], False)
    >>> read_digits_s(np.array([58.0, 59.0, 60.0, 61.0])) is None
    True
    """
    finite = numbers[np.isfinite(numbers)]
    low, high = (finite.min(), finite.max()) if len(finite) >= _FEWEST else (-1.0, -1.0)
    if low < 0.0:
        return None
    for factor, size in _CALENDAR:
        if size * 0.99 < low and high < size * 1.06:
            whole = numbers / factor
            day = np.floor(whole / 1e6)
            if _are_times_of_day(whole - day * 1e6, leaps=False):
                since = _count_days(day) * DAY_S + _of_day_s(whole - day * 1e6)
                return since, True, "times are dates by their digits, YYYYMMDDhhmmss"
    for program, (zero, (first, last)) in _DAYS_OF_1970.items():
        within = first < low and high < last
        if within and 0.0 < median(np.abs(np.diff(finite))) < _LONGEST_STEP_DAYS:
            unix = np.round((numbers - zero) * DAY_S, 4)
            counted = "count" if program.endswith("s") else "counts"
            return unix, True, f"times are days as {program} {counted} them"
    if high < 24 * _HOUR and _are_times_of_day(numbers, leaps=True):
        day_s = _of_day_s(numbers)
        known = np.isfinite(day_s)
        day_s[known] = np.unwrap(day_s[known], period=DAY_S)
        return day_s, False, "times of day without a date, by their digits hhmmss"
    return None


def _are_times_of_day(numbers: Array, *, leaps: bool) -> bool:
    """Whether all may be hhmmss, and, with `leaps`, show it where a minute ends."""
    known = numbers[np.isfinite(numbers)]
    for some in (known[:: len(known) // _FEW + 1], known):  # most that are none show it at once
        if (some % _MINUTE >= 60.0).any() or (some // _MINUTE % 100 >= 60).any():
            return False
    if (known >= 24 * _HOUR).any():
        return False
    if not leaps:
        return True
    ends = np.diff(known // _MINUTE) > 0
    leap, step = np.diff(known), np.diff(_of_day_s(known))
    usual = median(np.abs(step))
    if not ends.any() or (leap[ends] < 40.0).any() or usual >= 20.0:
        return False
    return bool(median(step[ends]) <= max(3.0 * usual, 1.5))


def _of_day_s(numbers: Array) -> Array:
    hours, minutes = numbers // _HOUR, numbers // _MINUTE % 100
    return np.asarray(3600.0 * hours + 60.0 * minutes + numbers % _MINUTE)


def _count_days(calendar: Array) -> Array:
    """Days from 1970-01-01 to dates YYYYMMDD; NaN for what is no date."""
    days = np.full(len(calendar), np.nan)
    for date in np.unique(calendar[np.isfinite(calendar)]):
        text = f"{int(date):08}"
        try:
            day = np.datetime64(f"{text[:4]}-{text[4:6]}-{text[6:]}", "D")
        except ValueError:
            continue
        days[calendar == date] = float(day.astype(np.int64))
    return days
