"""Times as files write them, into float64 seconds since an epoch."""

from __future__ import annotations

import re
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.logs.headers.quantities import DOCUMENT
from agonic.maths.one_pass import median
from agonic.units import DAY_S

Clock = tuple[Array | None, datetime | None, tuple[str, ...]]
"""Seconds, the UTC moment of second zero where it is known, and notes."""

UNIX = datetime(1970, 1, 1, tzinfo=UTC)

UNIX_SECONDS = (1e9, 4.1e9)
"""2001 to 2099: a clock that reads this many seconds counts from 1970, not from power-on."""
_ZONE = re.compile(r"\s+\(?([A-Z]{3,5})\)?$")
_NONE_READ = "times left out: none could be read"
NO_ZONE = "times name no zone: taken as UTC"
TIMES_OF_DAY = "times of day"
"""How the note on a clock without a date begins."""
_TIED_SHARE = 0.01
"""Share of rows with an unchanged clock but other readings, above which the clock is coarse."""


def read_clock(values: NDArray[Any], unit_s: float | None) -> Clock:
    """The clock that a time column holds. `values` are numbers, moments (datetime64) or texts;
    `unit_s` is one of the column's units in seconds, `None` where it does not say."""
    if values.dtype.kind == "M":
        known = values[~np.isnat(values)]
        if not len(known):
            return None, None, (_NONE_READ,)
        first = min(known[0], known[-1]).astype("datetime64[s]")
        epoch = UNIX + timedelta(seconds=int(first.astype(np.int64)))
        return (values - first) / np.timedelta64(1, "s"), epoch, ()
    if values.dtype.kind in "OUS":
        return _of_texts(values.astype(str).tolist())
    numbers = np.asarray(values, dtype=np.float64)
    if unit_s is None:
        return _without_unit(numbers)
    seconds = numbers / (1 / unit_s)  # 70 000 µs / 1e6 is 0.07 s; times 1e-6 is not
    return since_first_second(seconds, ()) if _is_unix(seconds) else (seconds, None, ())


def unwrap(values: Array, period: float) -> Array:
    """Values that wrap at a period, unwrapped in place; NaN stays NaN."""
    known = np.isfinite(values)
    values[known] = np.unwrap(values[known], period=period)
    return values


_TICKS = {"s": 1.0, "ms": 1e3, "µs": 1e6, "ns": 1e9}


def _without_unit(numbers: Array) -> Clock:
    """Unix times by their size, otherwise seconds where the steps can be seconds."""
    late = (numbers > UNIX_SECONDS[0]).any()
    for name, per_second in _TICKS.items() if late else ():
        if _is_unix(numbers / per_second):
            note = f"times have no unit; by their size they are Unix times in {name}"
            return since_first_second(numbers / per_second, (note,))
    from agonic.logs.clocks.dates import read_digits_s

    if (digits := read_digits_s(numbers)) is not None:
        seconds, dated, note = digits
        return since_first_second(seconds, (note,)) if dated else (seconds, None, (note,))
    finite = numbers[np.isfinite(numbers)]
    steps = (np.diff(some) for some in (finite[:1000], finite))  # most show it among the first
    whole = len(finite) > 1 and all((some == np.round(some)).all() for some in steps)
    if whole and (step := median(np.diff(finite))) > 1:
        if step >= 3e6:  # in microseconds they would be above 3 s, for which hardly anybody does
            note = f"times have no unit; by their steps of {step:g} they are taken as nanoseconds"
            return numbers / 1e9, None, (note,)
        note = (
            f"times left out: they have no unit and step by {step:g}; name the "
            "column time_s, time_ms or time_us"
        )
        return None, None, (note,)
    return numbers, None, ("times have no unit: taken as seconds",)


def _is_unix(seconds: Array) -> bool:
    low, high = UNIX_SECONDS
    if not (seconds > low).any():
        return False
    finite = seconds[np.isfinite(seconds)]
    step = median(np.abs(np.diff(finite))) if len(finite) > 1 else 0.0
    return bool(low < median(finite) < high and step <= 1000.0)


def since_first_second(unix: Array, notes: tuple[str, ...]) -> Clock:
    """Unix seconds as seconds since the whole second in which they start."""
    finite = unix[np.isfinite(unix)]
    if not len(finite):
        return None, None, (_NONE_READ,)
    start = float(np.floor(min(finite[0], finite[-1])))  # of a table newest first, the last
    return unix - start, UNIX + timedelta(seconds=start), notes


def to_moments(microseconds: Array, start: datetime = UNIX) -> NDArray[np.datetime64]:
    """Moments that are so many microseconds after another; what is not finite is no time."""
    known = np.isfinite(microseconds)
    steps = np.round(np.where(known, microseconds, 0.0)).astype("timedelta64[us]")
    stamps = np.datetime64(start.replace(tzinfo=None), "us") + steps
    stamps[~known] = np.datetime64("NaT", "us")
    return np.asarray(stamps)


def _of_texts(texts: list[str]) -> Clock:
    """Date-times of ISO 8601 (or with slashes), or times of day without a date."""
    from agonic.logs.clocks.dates import AMBIGUOUS, find_order, has_slashes, read_duration_s

    if texts and read_duration_s(texts[0]) is not None:
        spans = [read_duration_s(text) for text in texts]
        seconds = np.array([np.nan if s is None else s for s in spans])
        if ":" in texts[0] and seconds[np.isfinite(seconds)].max() < DAY_S / 24:  # mm:ss.0 of Excel
            seconds = unwrap(seconds, DAY_S / 24)
        return seconds, None, ()
    slashes = any(map(has_slashes, texts))
    order = find_order(texts) if slashes else None
    moments = [_moment(text, order) for text in texts]
    known = [moment for moment in moments if moment is not None]
    zone = _ZONE.search(texts[0].strip("\"' ")) if texts and not known else None
    if zone is not None:  # letters that stand for several zones: CST, IST
        time, start, notes = _of_texts([_ZONE.sub("", text.strip("\"' ")) for text in texts])
        ahead = DOCUMENT["zones"].get(zone[1])
        if start is not None and ahead is not None:
            return time, start - timedelta(hours=ahead), ()
        said = f"times name the zone {zone[1]}, which stands for several: taken as UTC"
        return time, start, notes if start is None else (said,)
    if not known:
        example = next((text for text in texts if text.strip()), "")
        note = f"times left out: {example[:40]!r} is not a time such as 2026-03-01T12:00:00.5Z"
        return None, None, (note,)
    first = min(known[0], known[-1]) if known[0].year > 1 else known[0]
    epoch = first.replace(microsecond=0)
    seconds = np.array(
        [np.nan if moment is None else (moment - epoch).total_seconds() for moment in moments]
    )
    if first.year > 1:
        tails = (text.strip()[10:] for text in texts[:9])
        named = any(t.upper().endswith(("Z", "UTC", "GMT")) or "+" in t or "-" in t for t in tails)
        return seconds, epoch, () if named else (NO_ZONE,)
    return (
        unwrap(seconds, DAY_S),
        None,
        (AMBIGUOUS if slashes else f"{TIMES_OF_DAY} without a date",),
    )


def _moment(text: str, order: str | None) -> datetime | None:
    """The UTC moment of a text; a time of day alone falls on day one of year one."""
    from agonic.logs.clocks.dates import write_iso

    plain = text.strip().strip("\"'").replace("/", "-")
    if (found := _of_iso(plain)) is None and (iso := write_iso(plain, order)) is not None:
        found = _of_iso(iso)
    return found


def _of_iso(text: str) -> datetime | None:
    for dated in (text, f"0001-01-01 {text}"):
        with suppress(ValueError, OverflowError):
            moment = datetime.fromisoformat(dated)
            return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)
    return None


def spread_ties(time: Array, field: Array) -> tuple[Array, tuple[str, ...]]:
    """Times of a coarse clock, with each run of equal times spread evenly over its tick. A clock is
    coarse where it stands still although the readings (n, 3) change, in more than a few rows; a
    repeated row is not a tick and is left for `Samples` to reject. Row i of a run of k at time t
    becomes t + (i/k) min(t' − t, median tick), t' being the next time."""
    rows = np.flatnonzero(np.isfinite(time))
    ticks = time[rows]
    still = ticks[1:] == ticks[:-1]
    if still.sum() <= max(_TIED_SHARE * len(ticks), 1):
        return time, ()
    moved = (np.diff(field[rows], axis=0) != 0).any(axis=1)
    if not (still & moved).sum() > max(_TIED_SHARE * len(ticks), 1):
        return time, ()
    starts = np.flatnonzero(np.append(True, ~still))
    lengths = np.diff(np.append(starts, len(ticks)))
    steps = np.diff(ticks[starts])
    forward = steps[steps > 0]
    tick = median(forward) if len(forward) else 0.0
    span = np.append(np.where(steps > 0, np.minimum(steps, tick), tick), tick)
    within = np.arange(len(ticks)) - np.repeat(starts, lengths)
    spread = time.copy()
    spread[rows] = ticks + within / np.repeat(lengths, lengths) * np.repeat(span, lengths)
    note = f"the clock stands still for up to {lengths.max()} rows: times spread over its tick"
    return spread, (note,)
