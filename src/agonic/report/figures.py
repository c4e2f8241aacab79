"""Strips: residuals over time and as a histogram, the magnitude before and after, as inline SVG.

The drawing area is stretched to the width of the page and the numbers at its edges are not: they
stand in strips of their own, at percentages.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agonic.calibrated import Calibrated
from agonic.report.digits import grouped
from agonic.report.markup import Markup, element
from agonic.report.quantities import unit_label
from agonic.report.residuals import Residuals

Array = NDArray[np.float64]

BINS = 400
"""Columns of a strip; the least and the largest value of each are drawn, so no peak is lost."""

_TIME_UNITS = ((7200.0, 3600.0, "h"), (300.0, 60.0, "min"), (0.0, 1.0, "s"))


@dataclass(frozen=True)
class Axis:
    """What is drawn along an edge of a strip: its label with the unit, and its range."""

    label: str
    low: float
    high: float

    def share(self, values: Array) -> Array:
        """Where values lie between the ends, 0…1; what lies beyond is drawn at the end."""
        return np.asarray(np.clip((values - self.low) / (self.high - self.low), 0.0, 1.0))

    def ticks(self, most: int = 6) -> Array:
        """Round numbers along the axis: steps of 1, 2 or 5 times a power of ten.

        >>> Axis("time, s", 0.0, 47.0).ticks()
        array([ 0., 10., 20., 30., 40.])
        """
        rough = (self.high - self.low) / most
        power = 10.0 ** np.floor(np.log10(rough))
        step = power * next(m for m in (1, 2, 5, 10) if m * power >= rough * (1 - 1e-9))
        first = np.ceil(self.low / step - 1e-9)
        last = np.floor(self.high / step + 1e-9)
        return np.asarray(np.arange(first, last + 1) * step + 0.0)  # the sum turns −0 into 0


def time_axis(result: Calibrated) -> tuple[Axis, Array]:
    """Time since the first reading, or the number of the reading where no times were logged."""
    time = result.samples.time
    if time is None or len(time) < 2:
        n = len(result.samples)
        return Axis("reading", 0.0, float(max(n - 1, 1))), np.arange(n, dtype=np.float64)
    duration = float(time[-1] - time[0])
    seconds, name = next((s, n) for least, s, n in _TIME_UNITS if duration >= least)
    along = (time - time[0]) / seconds
    return Axis(f"time since the first reading, {name}", 0.0, float(along[-1])), along


def residual_strip(result: Calibrated, residuals: Residuals) -> Markup:
    """Residuals over time with lines at the stated noise, and a bar under what was held out."""
    limit = residuals.limit
    x, along = time_axis(result)
    y = Axis(f"residual, {residuals.unit}", -limit, limit)
    mean = _averages(residuals.values, residuals.weights)
    layers = [
        _range(x, y, along, residuals.values, "range"),
        _path(f"M{_points(_right(x, _averages(along)), _down(y, mean))}", "mean"),
        *(_path(f"M0 {at:.0f}H1000", "noise")
          for at in _down(y, np.array([-1.0, 1.0]) * residuals.noise)),
    ]  # fmt: skip
    held_out = result.verification.held_out
    if held_out is not None:
        layers.append(_held_out(x, along, held_out))
    return _plot(x, y, layers, f"Residuals between −{limit:.3g} and +{limit:.3g} over time")


def residual_histogram(residuals: Residuals, bins: int = 60) -> Markup:
    """How often each residual occurs, with the normal curve of the stated noise."""
    limit = residuals.limit
    counts, edges = np.histogram(residuals.values, bins=bins, range=(-limit, limit))
    at = np.linspace(-limit, limit, 201)
    expected = len(residuals.values) * (edges[1] - edges[0]) * _normal(at, residuals.noise)
    x = Axis(f"residual, {residuals.unit}", -limit, limit)
    y = Axis("readings", 0.0, 1.05 * float(max(counts.max(), expected.max(), 1.0)))
    steps = np.repeat(_right(x, edges), 2)[1:-1], np.repeat(_down(y, counts * 1.0), 2)
    layers = [
        _path(f"M0 1000L{_points(*steps)}L1000 1000Z", "bars"),
        _path(f"M{_points(_right(x, at), _down(y, expected))}", "normal"),
    ]
    return _plot(x, y, layers, "Histogram of residuals with the normal curve of the stated noise")


def _normal(at: Array, sd: float) -> Array:
    """The normal density; nothing where there is no noise."""
    if sd == 0.0:
        return np.zeros_like(at)
    return np.asarray(np.exp(-0.5 * (at / sd) ** 2) / (sd * np.sqrt(2 * np.pi)))


def magnitude_strip(result: Calibrated) -> Markup:
    """The magnitude of the field over time, before and after the correction."""
    before, after = result.verification.magnitude_before, result.verification.magnitude_after
    both = np.concatenate([before, after])
    low, high = (float(v) for v in np.percentile(both, (0.25, 99.75)))
    margin = max(0.05 * (high - low), 1e-6 * abs(high), 1e-9)
    x, along = time_axis(result)
    unit = unit_label(result.fit.calibration.unit_out)
    y = Axis(f"magnitude, {unit}", low - margin, high + margin)
    layers = [_range(x, y, along, before, "before"), _range(x, y, along, after, "after")]
    return _plot(x, y, layers, "Magnitude of the field over time, before and after")


def _plot(x: Axis, y: Axis, layers: Sequence[Markup], label: str) -> Markup:
    """A strip: the area, and the ticks at its left and foot."""
    left, foot = y.ticks(), x.ticks()
    lines = [
        *(_path(f"M0 {at:.0f}H1000", "grid") for at in _down(y, left)),
        *(_path(f"M{at:.0f} 0V1000", "grid") for at in _right(x, foot)),
    ]
    return element(
        "div",
        element("p", y.label, class_="axis axis-y"),
        element("svg", *_tick_texts("y", left, _down(y, left)), class_="ticks-y",
                aria_hidden="true"),
        element("svg", *lines, *layers, class_="area", viewBox="0 0 1000 1000",
                preserveAspectRatio="none", role="img", aria_label=label),
        element("svg", *_tick_texts("x", foot, _right(x, foot)), class_="ticks-x",
                aria_hidden="true"),
        element("p", x.label, class_="axis axis-x"),
        class_="plot",
    )  # fmt: skip


def _tick_texts(coordinate: str, ticks: Array, places: Array) -> list[Markup]:
    step = ticks[1] - ticks[0] if len(ticks) > 1 else max(abs(ticks[0]), 1.0)
    decimals = max(0, -int(np.floor(np.log10(step) + 1e-9)))
    return [
        element("text", grouped(float(tick), decimals), **{coordinate: f"{place / 10:.1f}%"})
        for tick, place in zip(ticks, places, strict=True)
    ]


def _right(axis: Axis, values: Array) -> Array:
    return 1000.0 * axis.share(values)


def _down(axis: Axis, values: Array) -> Array:
    return 1000.0 * (1.0 - axis.share(values))


def _starts(n: int) -> NDArray[np.int64]:
    """The first row of each column of a strip."""
    return np.unique(np.linspace(0, n, min(n, BINS), endpoint=False).astype(np.int64))


def _averages(values: Array, weights: Array | None = None) -> Array:
    """The mean of each column of a strip, weighted where weights are given."""
    starts = _starts(len(values))
    counted = np.ones(len(values)) if weights is None else weights
    total = np.add.reduceat(counted, starts)
    sums = np.add.reduceat(counted * values, starts)
    return np.asarray(sums / np.maximum(total, np.finfo(float).tiny))


def _range(x: Axis, y: Axis, along: Array, values: Array, name: str) -> Markup:
    """A band from the least to the largest value of each column."""
    starts = _starts(len(values))
    right = _right(x, _averages(along))
    high = _down(y, np.maximum.reduceat(values, starts))
    low = _down(y, np.minimum.reduceat(values, starts))
    return _path(f"M{_points(right, high)}L{_points(right[::-1], low[::-1])}Z", name)


def _held_out(x: Axis, along: Array, held_out: NDArray[np.bool_]) -> Markup:
    """A bar along the foot under the columns that were mostly held out of the fit."""
    starts = _starts(len(along))
    inside = _averages(held_out.astype(np.float64)) > 0.5
    first = _right(x, along[starts])
    last = np.append(first[1:], 1000.0)
    bars = (f"M{a:.1f} 990H{b:.1f}" for a, b in zip(first[inside], last[inside], strict=True))
    return _path("".join(bars), "held-out")


def _points(right: Array, down: Array) -> str:
    return "L".join(f"{r:.1f} {d:.0f}" for r, d in zip(right, down, strict=True))


def _path(d: str, name: str) -> Markup:
    return element("path", d=d, class_=name)
