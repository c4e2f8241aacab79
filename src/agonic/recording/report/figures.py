"""Strips of one calibrated sensor: residuals over time and as a histogram, the magnitude before
and after."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.recording.calibrated import Calibrated
from agonic.recording.report.residuals import Residuals, parted
from agonic.report.labels import unit_label
from agonic.report.markup import Markup
from agonic.report.strips import (
    Axis,
    Columns,
    arrows,
    down,
    level,
    line,
    marked,
    path,
    plot,
    points,
    right,
    spread,
)
from agonic.report.time_axis import along_time


def time_axis(result: Calibrated) -> tuple[Axis, Array]:
    """Time since the first reading, or the number of the reading where no times were logged."""
    time = result.samples.time
    if time is None or len(time) < 2:
        n = len(result.samples)
        return Axis("reading", 0.0, float(max(n - 1, 1))), np.arange(n, dtype=np.float64)
    return along_time(time, float(time[0]), float(time[-1]))


def residual_strip(result: Calibrated, residuals: Residuals) -> Markup:
    """Residuals over time with lines at the stated noise, and a bar under what was held out."""
    limit = residuals.limit
    x, along = time_axis(result)
    y = Axis(f"residual, {residuals.unit}", -limit, limit)
    columns = Columns(x, along)
    layers = [
        spread(columns, y, residuals.values, "range"),
        line(columns, y, columns.mean(residuals.values, residuals.weights), "mean"),
        *(level(y, at * residuals.noise, "noise") for at in (-1.0, 1.0)),
    ]
    held_out = parted(result)
    if held_out is not None:
        layers.append(marked(columns, held_out, "held-out"))
    label = f"Residuals between −{limit:.3g} and +{limit:.3g} over time"
    return plot(x, y, layers, label, arrows(columns, y, residuals.values))


def residual_histogram(residuals: Residuals, bins: int = 60) -> Markup:
    """How often each residual occurs, with the normal curve of the stated noise."""
    limit = residuals.limit
    counts, edges = np.histogram(residuals.values, bins=bins, range=(-limit, limit))
    at = np.linspace(-limit, limit, 201)
    expected = len(residuals.values) * (edges[1] - edges[0]) * _normal(at, residuals.noise)
    x = Axis(f"residual, {residuals.unit}", -limit, limit)
    y = Axis("readings", 0.0, 1.05 * float(max(counts.max(), expected.max(), 1.0)))
    steps = np.repeat(right(x, edges), 2)[1:-1], np.repeat(down(y, counts * 1.0), 2)
    layers = [
        path(f"M0 1000L{points(*steps)}L1000 1000Z", "bars"),
        path(f"M{points(right(x, at), down(y, expected))}", "normal"),
    ]
    return plot(x, y, layers, "Histogram of residuals with the normal curve of the stated noise")


def _normal(at: Array, sd: float) -> Array:
    """The normal density; nothing where there is no noise."""
    if sd == 0.0:
        return np.zeros_like(at)
    return np.asarray(np.exp(-0.5 * (at / sd) ** 2) / (sd * np.sqrt(2 * np.pi)))


def magnitude_strip(result: Calibrated) -> Markup:
    """The magnitude of the field over time, before and after the correction.

    The axis holds what counted in the fit; of the rest, arrows say where it lies beyond.
    """
    before, after = result.verification.magnitude_before, result.verification.magnitude_after
    weights = result.fit.weights
    counted = np.ones(len(before), dtype=bool) if weights is None else weights > 0
    if not counted.any():
        counted[:] = True
    both = np.concatenate([before[counted], after[counted]])
    low, high = (float(v) for v in np.percentile(both, (0.25, 99.75)))
    reach = 0.25 * (high - low)  # so that noise is not cut off, and strays still are
    low, high = max(low - reach, float(both.min())), min(high + reach, float(both.max()))
    margin = max(0.05 * (high - low), 1e-6 * abs(high), 1e-9)
    x, along = time_axis(result)
    unit = unit_label(result.fit.calibration.unit_out)
    y = Axis(f"magnitude, {unit}", low - margin, high + margin)
    columns = Columns(x, along)
    layers = [spread(columns, y, before, "before"), spread(columns, y, after, "after")]
    words = "Magnitude of the field over time, before and after"
    return plot(x, y, layers, words, arrows(columns, y, after))
