"""Where on a strip things lie: its axes, and the columns that readings are put into."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from agonic.arrays import Array, Index

BINS = 400
"""Columns of a strip; the least and the largest value of each are drawn, so no peak is lost."""


@dataclass(frozen=True)
class Axis:
    """What is drawn along an edge of a strip: its label with the unit, and its range; equal ratios
    are equally long where it is logarithmic. Of an axis of time, `clock` is what the clock of the
    log reads at its ends, from which the page picks an interval."""

    label: str
    low: float
    high: float
    logarithmic: bool = False
    clock: tuple[float, float] | None = field(default=None, repr=False)

    def share(self, values: Array) -> Array:
        """Where values lie between the ends, 0…1; what lies beyond is drawn at the end."""
        if self.logarithmic:
            values = np.log10(np.maximum(values, self.low) / self.low)
            return np.asarray(np.minimum(values / np.log10(self.high / self.low), 1.0))
        return np.asarray(np.clip((values - self.low) / ((self.high - self.low) or 1.0), 0.0, 1.0))

    def ticks(self, most: int = 6) -> Array:
        """Round numbers along the axis: steps of 1, 2 or 5 times a power of ten."""
        if self.logarithmic:
            return self._decades()
        rough = (self.high - self.low) / most
        if not 1e-300 < rough < 1e300:  # all in one place, or too far apart to be told apart
            return np.array([self.low])
        power = 10.0 ** np.floor(np.log10(rough))
        step = power * next(m for m in (1, 2, 5, 10) if m * power >= rough * (1 - 1e-9))
        first = np.ceil(self.low / step - 1e-9)
        last = np.floor(self.high / step + 1e-9)
        return np.asarray(np.arange(first, last + 1) * step + 0.0)  # the sum turns −0 into 0

    def _decades(self) -> Array:
        """1, 2 and 5 times powers of ten; of long axes the powers."""
        powers = 10.0 ** np.arange(np.floor(np.log10(self.low)), np.ceil(np.log10(self.high)) + 1)
        steps = [1.0] if self.high / self.low > 300.0 else [1.0, 2.0, 5.0]
        marks = np.outer(powers, steps).ravel()
        return np.asarray(marks[(marks >= self.low * 0.999) & (marks <= self.high * 1.001)])


def fit_axis(label: str, values: Array) -> Axis:
    """An axis that holds the values, and never shows less than they can be told apart."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = max(0.06 * (high - low), 1e-7 * max(abs(low), abs(high)), 1e-9)
    return Axis(label, low - margin, high + margin)


class Columns:
    """Readings put into the columns of a figure by where they lie along its axis `x`. `right` (k,)
    is where each column with readings stands, thousandths of the area; `counts` (k,) how many it
    holds; `across` the same places in the unit of the axis, as `break_up` gives values."""

    def __init__(self, x: Axis, along: Array, most: int = BINS) -> None:
        self.x, self.most = x, max(1, min(most, len(along)))
        place = np.minimum((x.share(along) * self.most).astype(np.int32), self.most - 1)
        sorted_already = bool((np.diff(place) >= 0).all())
        self._order = None if sorted_already else np.argsort(place, kind="stable")
        counts = np.bincount(place, minlength=self.most)
        self.places = np.flatnonzero(counts)
        self.counts = counts[self.places]
        self._starts = np.cumsum(self.counts) - self.counts
        middle, steps = self.mean(along), np.diff(self.places)
        self.right = right(x, middle)
        wide = 3 * max(float(np.median(steps)), 1.0) if len(steps) else 1.0
        self._gaps = np.flatnonzero(steps > wide) + 1
        self.across = self.break_up(middle)

    def _sort(self, values: Array) -> Array:
        return values if self._order is None else values[self._order]

    def mean(self, values: Array, weights: Array | None = None) -> Array:
        """The mean of each column, weighted where weights are given; NaN where all are 0."""
        if weights is None:
            return np.asarray(np.add.reduceat(self._sort(values), self._starts) / self.counts)
        total = np.add.reduceat(self._sort(weights), self._starts)
        sums = np.add.reduceat(self._sort(weights * values), self._starts)
        means = np.full(len(sums), np.nan)
        np.divide(sums, total, out=means, where=total > 0)
        return means

    def least(self, values: Array) -> Array:
        """The least value of each column."""
        return np.asarray(np.minimum.reduceat(self._sort(values), self._starts))

    def largest(self, values: Array) -> Array:
        """The largest value of each column."""
        return np.asarray(np.maximum.reduceat(self._sort(values), self._starts))

    def percentiles(self, values: Array, wanted: Sequence[float]) -> Array:
        """Percentiles of each column, (len(wanted), k)."""
        parts = np.split(self._sort(values), self._starts[1:])
        return np.array([np.percentile(part, wanted) for part in parts]).T

    def edges(self) -> tuple[Array, Array]:
        """Where each column begins and ends, in the unit of the axis."""
        ends = np.linspace(self.x.low, self.x.high, self.most + 1)
        return ends[self.places], ends[self.places + 1]

    def break_up(self, values: Array) -> Array:
        """One value a column, with a NaN wherever there is a gap between columns."""
        return np.insert(values, self._gaps, np.nan)


def right(axis: Axis, values: Array) -> Array:
    """Thousandths of the area from the left."""
    return 1000.0 * axis.share(values)


def down(axis: Axis, values: Array) -> Array:
    """Thousandths of the area from the top."""
    return 1000.0 * (1.0 - axis.share(values))


_TIME_UNITS = (
    (172_800.0, 86_400.0, "days"),
    (7200.0, 3600.0, "h"),
    (300.0, 60.0, "min"),
    (0.0, 1.0, "s"),
)


def along_time(
    time: Array, start: float, stop: float, since: str = "the first reading"
) -> tuple[Axis, Array]:
    """An axis of the time since `start` in a unit that fits, and times as they lie along it."""
    seconds, name = next((s, n) for least, s, n in _TIME_UNITS if stop - start >= least)
    label = f"time since {since}, {name}"
    return Axis(label, 0.0, (stop - start) / seconds), (time - start) / seconds


def along_rows(time: Array | None, rows: Index) -> tuple[Axis, Array]:
    """Time since the first reading, or the number of the reading where no times were logged. `time`
    (n,) is that of all readings, `rows` (m,) those that are shown. Findings tell moments by the
    clock of the log, so the label says where it stood at the first reading."""
    if time is None or len(time) < 2:
        return Axis("reading", 0.0, float(max(rows.max(), 1))), rows.astype(np.float64)
    start, stop = float(time[0]), float(time[-1])
    begun = "" if start == 0.0 else f" (t = {start:.1f} s)"
    axis, along = along_time(time[rows], start, stop, since=f"the first reading{begun}")
    return replace(axis, clock=(start, stop)), along


def over_rows(time: Array | None, n: int, most: int = BINS) -> Columns:
    """The columns of `n` readings over time, or in their order where no times were logged."""
    return Columns(*along_rows(time, np.arange(n)), most)


def over_time(time: Array, since: str = "the first reading", most: int = BINS) -> Columns:
    """The columns of readings over their times (n,), from the first to the last."""
    return Columns(*along_time(time, float(time[0]), float(time[-1]), since), most)


def about_zero(label: str, limit: float) -> Axis:
    """An axis with zero in its middle."""
    return Axis(label, -limit, limit)
