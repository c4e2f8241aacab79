"""Moments as people and programs write them, made into ISO 8601.

What is not ISO 8601 already: day, month, year with dots (`3.5.2026 8:15`), month names
(`03-May-2026 08:15:30`), AM and PM, a colon before the milliseconds, `UTC` behind, and dates with
slashes, whose order of day and month the whole column must show.

Numbers may be dates or times of day by their digits, 81530.25 for 08:15:30.25, or days of Excel.
Taken as seconds they would run wrong without a word: after 81559 comes 81600.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import suppress

import numpy as np

from agonic.arrays import Array
from agonic.logs.headers.quantities import DOCUMENT, TIMES
from agonic.maths.one_pass import median
from agonic.units import DAY_S


def read_digits_s(numbers: Array) -> tuple[Array, bool, str] | None:
    """Seconds of numbers that are calendar dates or times of day, whether since 1970, and a note.
    `None` where they are plain numbers. A time of day is told by its minutes: no number has more
    than 59 seconds, and from one minute to the next it leaps by 40 more than otherwise."""
    finite = numbers[np.isfinite(numbers)]
    low, high = (finite.min(), finite.max()) if len(finite) > 2 else (-1.0, -1.0)
    if low < 0.0:
        return None
    for factor, size in ((1.0, 2e13), (1e3, 2e16)):  # the second with milliseconds
        if size * 0.99 < low and high < size * 1.06:
            whole = numbers / factor
            day = np.floor(whole / 1e6)
            if _are_times_of_day(whole - day * 1e6, leaps=False):
                since = _count_days(day) * DAY_S + _of_day_s(whole - day * 1e6)
                return since, True, "times are dates by their digits, YYYYMMDDhhmmss"
    for program, (zero, first, last) in DOCUMENT["days"].items():
        within = first < low and high < last
        if within and 0.0 < median(np.abs(np.diff(finite))) < 1e-3:
            unix = np.round((numbers - zero) * DAY_S, 4)
            counted = "count" if program.endswith("s") else "counts"
            return unix, True, f"times are days as {program} {counted} them"
    if high < 240_000 and _are_times_of_day(numbers, leaps=True):
        day_s = _of_day_s(numbers)
        known = np.isfinite(day_s)
        day_s[known] = np.unwrap(day_s[known], period=DAY_S)
        return day_s, False, "times of day without a date, by their digits hhmmss"
    return None


def _are_times_of_day(numbers: Array, *, leaps: bool) -> bool:
    """Whether all may be hhmmss, and, with `leaps`, show it where a minute ends."""
    known = numbers[np.isfinite(numbers)]
    for some in (known[:: len(known) // 1000 + 1], known):  # most that are none show it at once
        if (some % 100 >= 60.0).any() or (some // 100 % 100 >= 60).any():
            return False
    if (known >= 240_000).any():
        return False
    if not leaps:
        return True
    ends = np.diff(known // 100) > 0
    leap, step = np.diff(known), np.diff(_of_day_s(known))
    usual = median(np.abs(step))
    if not ends.any() or (leap[ends] < 40.0).any() or usual >= 20.0:
        return False
    return bool(median(step[ends]) <= max(3.0 * usual, 1.5))


def _of_day_s(numbers: Array) -> Array:
    hours, minutes = numbers // 10_000, numbers // 100 % 100
    return np.asarray(3600.0 * hours + 60.0 * minutes + numbers % 100)


def _count_days(calendar: Array) -> Array:
    """Days from 1970-01-01 to dates YYYYMMDD; NaN for what is no date."""
    days = np.full(len(calendar), np.nan)
    for date in np.unique(calendar[np.isfinite(calendar)]):
        text = f"{int(date):08}"
        with suppress(ValueError):
            day = np.datetime64(f"{text[:4]}-{text[4:6]}-{text[6:]}", "D")
            days[calendar == date] = float(day.astype(np.int64))
    return days


_MONTHS = "jan feb mar apr may jun jul aug sep oct nov dec".split()  # noqa: SIM905
_CLOCK = re.compile(
    r"(?P<hour>\d{1,2}):(?P<minute>\d\d)"
    r"(?::(?P<second>\d\d)(?:[.,:](?P<part>\d{1,9}))?|:(?P<bare>\d{1,2}):(?P<ms>\d{1,3}))?"
    r"\s*(?P<half>[ap]\.?m\.?)?\s*(?P<zone>z|utc|gmt|[+-]\d\d:?\d\d)?",
    re.IGNORECASE,
)
_MILLISECONDS = re.compile(r"\d:\d\d:\d{1,2}:(\d{1,3})(?!\d)\s*(?:[AaPpZz]|$)")
"""Behind a colon, a number of them: 17:16:1:35 is 35 ms after 17:16:01."""
_YEAR_FIRST = re.compile(r"(?P<year>\d{4})[-/.](?P<month>\d{1,2})[-/.](?P<day>\d{1,2})")
_NAMED = re.compile(r"(?P<day>\d{1,2})[- .]+(?P<month>[a-z]{3})[a-z]*[- .,]+(?P<year>\d{4})", re.I)
_DOTS = re.compile(r"(?P<day>\d{1,2})\.(?P<month>\d{1,2})\.(?P<year>\d{4})")
_SLASHES = re.compile(r"(?P<first>\d{1,2})[-/](?P<other>\d{1,2})[-/](?P<year>\d{4}|\d\d(?!\d))")
_DATE = re.compile(r"(?P<date>[^:]*?)[T ,_]*(?P<clock>\d{1,2}:\d\d.*)", re.IGNORECASE)
_DURATION = re.compile(r"([-+]?[\d.]+(?:e[-+]?\d+)?)\s*(s|secs?|seconds?|ms|min)", re.IGNORECASE)
_MINUTES = re.compile(r"(\d{1,3}):(\d\d[.,]\d+)")
_DAYS = re.compile(r"(-?\d{1,6}) days?,? \+?(\d\d?):(\d\d):(\d\d(?:\.\d+)?)")

DAY_FIRST, MONTH_FIRST = "day first", "month first"
AMBIGUOUS = "dates left out: they may be day/month or month/day; write 2026-03-01"


def find_order(texts: Iterable[str]) -> str | None:
    """Whether dates with slashes have the day or the month first; `None` where nothing shows it."""
    for text in texts:
        if match := _SLASHES.match(text.strip()):
            if int(match["first"]) > 12 and len(match["year"]) == 4:  # 22/01/13 may begin with 2022
                return DAY_FIRST
            if int(match["other"]) > 12:
                return MONTH_FIRST
    return None


def has_slashes(text: str) -> bool:
    """Whether a text begins with a date whose order must be found."""
    return _SLASHES.match(text.strip()) is not None


def write_iso(text: str, order: str | None) -> str | None:
    """A moment, or a time of day, as ISO 8601; `None` where it is neither. `order` is that of day
    and month in dates with slashes; without, those lose their date."""
    plain = text[:80].strip().strip("\"'")
    split = _DATE.fullmatch(plain)
    clock = _CLOCK.fullmatch(split["clock"].strip()) if split else None
    if split is None or clock is None:
        return None
    day = _write_date(split["date"].strip(), order)
    if day is None:
        return None
    hour = int(clock["hour"])
    if half := (clock["half"] or "").lower():
        hour = hour % 12 + (12 if half.startswith("p") else 0)
    part = (clock["part"] or "0").ljust(6, "0")[:6]
    if (ms := _MILLISECONDS.search(split["clock"])) is not None:
        part = f"{int(ms[1]):03}000"
    zone = (clock["zone"] or "").lower()
    zone = "+00:00" if zone in ("z", "utc", "gmt") else zone
    second = int(clock["second"] or clock["bare"] or 0)
    moment = f"{hour:02}:{clock['minute']}:{second:02}.{part}{zone}"
    return f"{day}T{moment}" if day else moment


def _write_date(text: str, order: str | None) -> str | None:
    """A date as ISO 8601; "" for none, `None` for what is no date."""
    if not text:
        return ""
    if match := _YEAR_FIRST.fullmatch(text) or _DOTS.fullmatch(text):
        month, day = match["month"], match["day"]
    elif match := _NAMED.fullmatch(text):
        name = match["month"].lower()
        if name not in _MONTHS:
            return None
        month, day = str(_MONTHS.index(name) + 1), match["day"]
    elif match := _SLASHES.fullmatch(text):
        if order is None:
            return ""
        first, other = match["first"], match["other"]
        month, day = (other, first) if order == DAY_FIRST else (first, other)
    else:
        return None
    year = match["year"] if len(match["year"]) == 4 else f"20{match['year']}"
    return f"{year}-{int(month):02}-{int(day):02}"


def read_duration_s(text: str) -> float | None:
    """Seconds of a number with a unit of time behind it, or of minutes and seconds with a point.
    `None` for anything else."""
    plain = text[:80].strip().strip("\"'")
    if match := _DAYS.fullmatch(plain):
        days, hours, minutes, seconds = match.groups()
        return DAY_S * int(days) + 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds)
    if match := _MINUTES.fullmatch(plain):
        return 60.0 * int(match[1]) + float(match[2].replace(",", "."))
    match = _DURATION.fullmatch(plain)
    with suppress(ValueError):
        return float(match[1]) * TIMES.get(match[2].lower(), (1.0,))[0] if match else None
    return None
