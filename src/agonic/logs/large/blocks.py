"""Readings and times alone, as a Parquet table stores them: the columns that a long fit sweeps.

A `Samples` is checked, copied and put into units; for 10⁸ rows that costs more than reading them. A
strip is the columns as they were decoded, with the factor and the clock that go with them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.logs import parquet
from agonic.logs.clocks.clock import read_clock
from agonic.logs.headers.columns import identify_columns
from agonic.logs.remote import Remote
from agonic.samples import Samples
from agonic.units import RAW, nanotesla_per

Column = NDArray[Any]

ROWS = 65_536
"""Rows in a strip: two megabytes, some of them ahead of the work."""

_SECONDS = np.array([1e-9, 1e-6, 1e-3, 1.0, 60.0, 3600.0, 86400.0])
_BESIDE = ("sensor", "date", "epoch", "frame")


class Strip(NamedTuple):
    """Some rows: x, y, z (n,) as stored, the factor to the unit of the fit, times (n,) in seconds
    where they were asked for, and why how many other rows are left out."""

    columns: tuple[Column, Column, Column]
    factor: float
    time: Array | None
    rejected: Mapping[str, int]

    def __len__(self) -> int:
        return len(self.columns[0])

    def select(self, rows: NDArray[Any], rejected: Mapping[str, int]) -> Strip:
        """Some of the rows, and why the others are left out."""
        x, y, z = (column[rows] for column in self.columns)
        time = None if self.time is None else self.time[rows]
        return Strip((x, y, z), self.factor, time, {**self.rejected, **rejected})


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Which columns of a file are the readings and the time, and how they are counted:
    field = factor · stored, seconds = begun + scale · (stored − first)."""

    axes: tuple[str, str, str]
    factor: float
    time: str | None
    first: Any = 0
    scale: float = 1.0
    begun: float = 0.0


def find_layout(table: Mapping[str, Column], head: Samples, unit: str | None) -> Layout | None:
    """The layout of a file whose first rows are a table, read as `head` with the unit given.

    None where the columns need more than a factor and a steady clock: several sensors in one
    table, dates in texts, a clock that stands still.
    """
    found = identify_columns(table)
    axes = found["field"].get(head.name.removeprefix("mag"))
    times = found.get("time", {})
    if axes is None or any(name in found for name in _BESIDE) or len(times) > 1:
        return None
    headers = (axes["x"].header, axes["y"].header, axes["z"].header)
    if any(table[header].dtype.kind not in "fiu" for header in headers):
        return None
    named = axes["x"].unit
    factor = nanotesla_per(unit or RAW if named in (None, RAW) else named)
    if head.time is None:
        return None if times else Layout(axes=headers, factor=factor, time=None)
    column, *others = next(iter(times.values())).values()
    if others:
        return None
    stored = table[column.header]
    if stored.dtype.kind not in "fiuM" or len(stored) < 2:
        return None
    seconds = read_clock(stored, column.quantity.units[column.unit][0] if column.unit else None)[0]
    if seconds is None or not (np.diff(seconds) > 0).all():
        return None
    numbers = _numbers(stored)
    scale = (seconds[-1] - seconds[0]) / float(numbers[-1] - numbers[0])
    exact = float(_SECONDS[np.argmin(np.abs(np.log(_SECONDS / scale)))])
    if abs(scale / exact - 1) > 1e-6:
        return None
    return Layout(
        axes=headers,
        factor=factor,
        time=column.header,
        first=numbers[0],
        scale=exact,
        begun=float(seconds[0]),
    )


def _numbers(stored: Column) -> Column:
    return stored.view(np.int64) if stored.dtype.kind == "M" else stored


def sweep(path: Path | Remote, of: Layout, size: int) -> Iterator[Strip]:
    """The strips of a Parquet file; rows that are not finite, or whose time does not increase, are
    left out and counted."""
    time = of.time
    last = -np.inf
    for table in parquet.read_ahead(path, size, [*of.axes, *([time] if time else [])]):
        x, y, z = (table[header] for header in of.axes)
        seconds = None
        if time is not None:
            seconds = (_numbers(table[time]) - of.first) * of.scale + of.begun
        strip = keep_usable(Strip((x, y, z), of.factor, seconds, {}), last)
        if strip.time is not None and len(strip):
            last = float(strip.time[-1])
        yield strip


def keep_usable(strip: Strip, last: float) -> Strip:
    """The rows of a strip that `Samples` would keep, after a row at the time `last`."""
    with np.errstate(invalid="ignore", over="ignore"):
        total = sum(float(column.sum(dtype=np.float64)) for column in strip.columns)
    time = strip.time
    if np.isfinite(total) and (time is None or (time[0] > last and (time[1:] > time[:-1]).all())):
        return strip
    keep = np.all([np.isfinite(column) for column in strip.columns], axis=0)
    rejected = {"NaN or infinite field": int((~keep).sum())}
    if time is not None:
        known = np.isfinite(time)
        rejected["NaN or infinite time"] = int((keep & ~known).sum())
        keep &= known
        latest = np.maximum.accumulate(np.where(keep, time, -np.inf))
        before = np.concatenate([[last], np.maximum(latest[:-1], last)])
        rejected["time does not increase"] = int((keep & ~(time > before)).sum())
        keep &= time > before
    return strip.select(keep, {why: count for why, count in rejected.items() if count})
