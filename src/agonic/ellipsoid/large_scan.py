"""The first pass over a long recording: rows to look at, what is left out, moments if wanted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index, Mask
from agonic.errors import LogError
from agonic.health.readings import find_clipped_rows, find_stuck_rows
from agonic.maths.estimation.noise.batch_means import SHORTEST, STRETCHES
from agonic.moments import Moments
from agonic.provenance import Input
from agonic.samples import COLUMNS, Samples

Columns = tuple[NDArray[Any], NDArray[Any], NDArray[Any]]
Progress = Callable[[str, int], None]

MOST = 100_000
"""Rows that are kept in memory: for the start, for what rows tell, and for pictures."""


class Strip(Protocol):
    """Some rows as they are stored; `agonic.logs.large.blocks.Strip` is one."""

    @property
    def columns(self) -> Columns: ...
    @property
    def factor(self) -> float: ...
    @property
    def time(self) -> Array | None: ...
    @property
    def rejected(self) -> Mapping[str, int]: ...
    @property
    def field(self) -> Array: ...
    def __len__(self) -> int: ...


class Recording(Protocol):
    """Readings strip by strip, the same each time; `agonic.logs.large.mission.Mission` is one."""

    @property
    def rows(self) -> int: ...
    @property
    def inputs(self) -> tuple[Input, ...]: ...
    def head(self) -> Samples: ...
    def strips(self, *, timed: bool = True) -> Iterator[Strip]: ...


class Spoilt(NamedTuple):
    """Rows start…stop in which an axis reads a value are left out: clipped, or stuck there."""

    axis: int
    value: float
    start: int
    stop: int


class Scan(NamedTuple):
    """What the first pass found: `samples` every so many-th row, drawn within its stride; `rows`
    how many there are and `largest` the largest reading on any axis; `timed` whether later passes
    must look at the times as well, to leave the same rows out; `stretch` rows in a stretch of time,
    and `begun` when each began."""

    samples: Samples
    stride: int
    rows: int
    largest: float
    rejected: Mapping[str, int]
    timed: bool
    spoilt: tuple[Spoilt, ...]
    stretch: int
    begun: Array | None
    moments: Moments | None


class Segment(NamedTuple):
    """Usable readings of one stretch."""

    stretch: int
    columns: Columns
    factor: float


def scan_recording(recording: Recording, summed: bool, seed: int, report: Progress) -> Scan:
    """The first pass; `summed` adds the moments up."""
    drawn = _draw_rows(recording.rows, seed)
    stride = max(-(-recording.rows // MOST), 1)
    long = max(-(-recording.rows // STRETCHES), SHORTEST)
    fields, times, begun = [], [], []
    rejected: Counter[str] = Counter()
    moments: Moments | None = None
    done, largest = 0, 0.0
    head = recording.head()
    for strip in recording.strips():
        rejected.update(strip.rejected)
        if not len(strip):
            continue
        mine = slice(*np.searchsorted(drawn, (done, done + len(strip))))
        rows = drawn[mine] - done
        fields.append(np.stack([column[rows] for column in strip.columns], axis=1) * strip.factor)
        edges = np.arange(-(-done // long) * long, done + len(strip), long) - done
        if strip.time is not None:
            times.append(strip.time[rows])
            begun.append(strip.time[edges])
        ends = [abs(float(end)) for c in strip.columns for end in (c.min(), c.max())]
        largest = max(largest, max(ends) * strip.factor)
        if summed:
            field = strip.field
            moments = Moments.of(field, unit=head.unit) if moments is None else moments.add(field)
        done += len(strip)
        report("reading", done)
    if not done:
        raise LogError("the recording holds no usable readings")
    known = len(times) == len(fields)
    columns = dict.fromkeys(COLUMNS) | {
        "field": np.concatenate(fields),
        "time": np.concatenate(times) if known else None,
        "source": replace(head.origin, count=done),
    }
    samples = head.with_columns(**columns, rejected={})
    scan = Scan(
        samples,
        stride,
        done,
        largest,
        dict(rejected),
        any("time" in why for why in rejected),
        _find_spoilt(samples.field, drawn, done, stride),
        long,
        np.concatenate(begun) if known else None,
        moments,
    )
    return (
        scan._replace(moments=_sum_moments(recording, scan, report))
        if scan.spoilt and summed
        else scan
    )


def read_segments(
    recording: Recording, scan: Scan, report: Callable[[int], None]
) -> Iterator[Segment]:
    """The usable readings, stretch by stretch, for one more pass."""
    done = 0
    for strip in recording.strips(timed=scan.timed):
        n = len(strip)
        bad = _find_bad_rows(strip, scan.spoilt, done)
        for stretch in range(done // scan.stretch, -(-(done + n) // scan.stretch)):
            start = max(stretch * scan.stretch - done, 0)
            part = slice(start, min((stretch + 1) * scan.stretch - done, n))
            x, y, z = (column[part] for column in strip.columns)
            if bad is not None:
                kept = ~bad[part]
                x, y, z = x[kept], y[kept], z[kept]
            if len(x):
                yield Segment(stretch, (x, y, z), strip.factor)
        done += n
        report(done)


def _draw_rows(rows: int, seed: int) -> Index:
    """One row of each stride, drawn, for what turns in step with the stride would be missed."""
    stride = max(-(-rows // MOST), 1)
    starts = np.arange(0, rows, stride)
    offsets = np.random.default_rng(seed).integers(0, stride, len(starts))
    return np.asarray(np.minimum(starts + offsets, rows - 1))


def _find_spoilt(field: Array, drawn: Index, rows: int, stride: int) -> tuple[Spoilt, ...]:
    """The values at which axes are clipped, and the stretches in which one is stuck."""
    found = []
    clipped = field[find_clipped_rows(field)]
    for axis in range(3) if len(clipped) else ():
        for end in (field[:, axis].max(), field[:, axis].min()):
            if (clipped[:, axis] == end).any():
                found.append(Spoilt(axis, float(end), 0, rows))
    for axis in range(3):
        stuck = find_stuck_rows(field, axis)
        if stuck.all():
            continue
        edges = np.flatnonzero(np.diff(np.concatenate([[False], stuck, [False]])))
        for start, stop in edges.reshape(-1, 2):
            first, last = int(drawn[start]) - stride, int(drawn[stop - 1]) + stride
            found.append(Spoilt(axis, float(field[start, axis]), max(first, 0), last))
    return tuple(found)


def _find_bad_rows(strip: Strip, spoilt: tuple[Spoilt, ...], done: int) -> Mask | None:
    """The rows of a strip that are spoilt, or None."""
    bad = np.zeros(len(strip), dtype=bool)
    for axis, value, start, stop in spoilt:
        rows = slice(max(start - done, 0), max(stop - done, 0))
        bad[rows] |= strip.columns[axis][rows] * np.float64(strip.factor) == value
    return bad if bad.any() else None


def _sum_moments(recording: Recording, scan: Scan, report: Progress) -> Moments:
    """The moments once more, without what turned out to be spoilt."""
    assert scan.moments is not None
    sums = Moments(
        centre=scan.moments.centre,
        scale=scan.moments.scale,
        sums=np.zeros(35),
        unit=scan.moments.unit,
    )
    for _, columns, factor in read_segments(
        recording, scan, lambda done: report("once more", done)
    ):
        sums = sums.add(np.stack(columns, axis=1) * np.float64(factor))
    return sums
