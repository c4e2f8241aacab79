"""Residuals of a session as bars or over time, as SVG."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.report.axes import Axis, Columns, along_rows, down, right
from agonic.report.digits import MINUS
from agonic.report.markup import Markup, element
from agonic.report.strips import caption, level, line, path, plot

LEAST_BARS = 5.0
"""Bars that the axis of a session has room for at least, so that its ticks are whole numbers."""


def draw_residuals(
    values: Array, sd: Array, numbers: NDArray[np.int64], along: str = "orientation"
) -> Markup:
    """Residuals (k, 3), nT, of the orientations `numbers` (k,), a bar an axis.

    Bands reach to twice the standard deviations `sd` (k, 3), nT. `along` is what the numbers count.

    >>> drawn = draw_residuals(np.array([[1.0, -2.0, 0.5]]), np.ones((1, 3)), np.array([7]))
    >>> drawn.count('class="bar-'), "residual, nT" in drawn
    (3, True)
    """
    limit = 1.1 * max(float(np.abs(values).max()), 2 * float(sd.max()), 1e-12)
    at: Array = np.unique(numbers).astype(np.float64)
    step = float(np.diff(at).min()) if len(at) > 1 else 1.0
    last = max(at[-1], at[0] + step * (LEAST_BARS - 1))
    x = Axis(along, float(at[0]) - step / 2, float(last) + step / 2)
    y = Axis("residual, nT", -limit, limit)
    at, reach = numbers.astype(np.float64), 2 * np.sqrt((sd**2).mean(axis=1))
    layers = [_bars(x, y, at, 0.42 * step, -reach, reach, "band")]
    for name, shift, one in zip("xyz", (-0.24, 0.0, 0.24), values.T, strict=True):
        zero = np.zeros(len(one))
        layers.append(_bars(x, y, at + shift * step, 0.1 * step, zero, one, f"bar-{name}"))
    keys = {f"bar-{name}": name for name in "xyz"} | {"band": "± 2 standard deviations"}
    drawn = plot(x, y, [*layers, level(y, 0.0, "zero")], "Residuals of each orientation in nT")
    return caption("Residuals along the magnetometer’s axes", drawn, keys)


def draw_figure(drawn: Markup, caption: str) -> Markup:
    """A drawing with what it shows in words below."""
    return element("figure", drawn, element("figcaption", caption))


def draw_settings(values: Array, unit: str) -> Markup:
    """What is left of each setting (k,), a bar each, numbered from one.

    >>> draw_settings(np.array([1.0, -2.0]), "nT").count('class="bar-x"')
    1
    """
    numbers = np.arange(1.0, len(values) + 1)
    x = Axis("setting", 0.5, max(len(values), LEAST_BARS) + 0.5)
    y = make_residual_axis(values, unit)
    bars = _bars(x, y, numbers, 0.3, np.zeros(len(values)), values, "bar-x")
    return caption("Residuals", plot(x, y, [bars, level(y, 0.0, "zero")], "Residuals"))


def _bars(
    x: Axis, y: Axis, middle: Array, half: float, start: Array, end: Array, name: str
) -> Markup:
    """Bars (k,) about the places `middle`, from one value to another."""
    edges = right(x, middle - half), right(x, middle + half), down(y, start), down(y, end)
    bars = (f"M{a:.1f} {c:.1f}H{b:.1f}V{d:.1f}H{a:.1f}Z" for a, b, c, d in zip(*edges, strict=True))
    return path("".join(bars), name)


def svg(parts: list[Markup], name: str, wide: float, high: float, label: str) -> Markup:
    """A drawing of a class, in its own units, with what it shows in words."""
    box = f"0 0 {wide:g} {high:g}"
    return element("svg", *parts, class_=name, viewBox=box, role="img", aria_label=label)


def svg_text(x: float, y: float, text: str, name: str) -> Markup:
    """Text of a class at a place."""
    return element("text", text.replace("-", MINUS), x=f"{x:.1f}", y=f"{y:.1f}", class_=name)


def draw_series(values: Array, time: Array | None, names: Sequence[str], unit: str) -> list[Markup]:
    """Columns of values (n, k) over time, a strip each; without times in their order."""
    x, along = along_rows(time, np.arange(len(values)))
    y, columns = make_residual_axis(values, unit), Columns(x, along)
    drawn = []
    for name, one in zip(names, values.T, strict=True):
        layers = [level(y, 0.0, "noise"), line(columns, y, columns.mean(one), "mean")]
        drawn.append(caption(name, plot(x, y, layers, f"Residuals {name}")))
    return drawn


def make_residual_axis(values: Array, unit: str) -> Axis:
    """The axis of residuals, zero in its middle."""
    limit = 1.1 * max(float(np.abs(values).max()), 1e-9)
    return Axis(f"residual, {unit}", -limit, limit)
