"""Residuals of a session as bars or over time, as SVG, and where they came from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.citations import find_citation
from agonic.provenance import Input, Provenance
from agonic.report.digits import MINUS, count
from agonic.report.document import Section
from agonic.report.markup import Markup, element
from agonic.report.strips import Axis, Columns, caption, level, line, plot
from agonic.report.time_axis import along_rows

WIDE, HIGH, LEFT, FOOT = 760.0, 200.0, 52.0, 24.0


def draw_residuals(values: Array, sd: Array, numbers: NDArray[np.int64]) -> Markup:
    """Residuals (k, 3), nT, of the orientations `numbers` (k,), a bar an axis.

    Bands reach to twice the standard deviations `sd` (k, 3), nT.

    >>> drawn = draw_residuals(np.array([[1.0, -2.0, 0.5]]), np.ones((1, 3)), np.array([7]))
    >>> drawn.count("<rect"), "−2" in drawn
    (4, True)
    """
    limit = 1.05 * max(float(np.abs(values).max()), 2 * float(sd.max()), 1e-12)
    step = (WIDE - LEFT) / len(values)

    def place(value: float) -> float:
        return (HIGH - FOOT) * (0.5 - value / (2 * limit)) + 4

    parts = [element("path", d=f"M{LEFT} {place(0):.1f}H{WIDE}", class_="zero")]
    for tick in (-limit / 1.05, limit / 1.05):
        parts.append(svg_text(LEFT - 6, place(tick) + 4, f"{tick:.2g}", "tick"))
    for k, number in enumerate(numbers.tolist()):
        at = LEFT + step * k
        reach = place(0) - place(2 * float(np.sqrt((sd[k] ** 2).mean())))
        parts.append(_bar(at + 0.08 * step, place(0) - reach, 0.84 * step, 2 * reach, "band"))
        for axis, value in zip("xyz", values[k].tolist(), strict=True):
            left = at + (0.16 + 0.24 * "xyz".index(axis)) * step
            high = max(abs(place(value) - place(0)), 0.5)
            parts.append(_bar(left, place(max(value, 0.0)), 0.2 * step, high, f"bar-{axis}"))
        parts.append(svg_text(at + step / 2, HIGH - 4, str(number), "tick middle"))
    return svg(parts, "bars", WIDE, HIGH, "Residuals of each orientation in nT")


def svg(parts: list[Markup], name: str, wide: float, high: float, label: str) -> Markup:
    """A drawing of a class, in its own units, with what it shows in words."""
    box = f"0 0 {wide:g} {high:g}"
    return element("svg", *parts, class_=name, viewBox=box, role="img", aria_label=label)


def svg_text(x: float, y: float, text: str, name: str) -> Markup:
    """Text of a class at a place."""
    return element("text", text.replace("-", MINUS), x=f"{x:.1f}", y=f"{y:.1f}", class_=name)


def _bar(x: float, y: float, wide: float, high: float, name: str) -> Markup:
    return element(
        "rect", x=f"{x:.1f}", y=f"{y:.1f}", width=f"{wide:.1f}", height=f"{high:.1f}", class_=name
    )


def draw_series(values: Array, time: Array | None, names: Sequence[str], unit: str) -> list[Markup]:
    """Columns of values (n, k) over time, a strip each; without times in their order."""
    x, along = along_rows(time, np.arange(len(values)))
    limit = 1.1 * max(float(np.abs(values).max()), 1e-9)
    y, columns = Axis(f"residual, {unit}", -limit, limit), Columns(x, along)
    strips = (
        [level(y, 0.0, "noise"), line(columns, y, columns.mean(one), "mean")] for one in values.T
    )
    return [
        caption(name, plot(x, y, layers, f"Residuals {name}"))
        for name, layers in zip(names, strips, strict=True)
    ]


def list_inputs(*inputs: Input | None, method: Sequence[str] = ()) -> Section:
    """Where a result came from: files with their checksums, the software, published sources."""
    files = {one.sha256: one for one in inputs if one is not None}
    made = Provenance()
    entries = {
        "Inputs": "; ".join(
            f"{one.name}, {count(one.count, 'row')}, SHA-256 {one.sha256}" for one in files.values()
        ),
        "Software": f"{made.software}, {made.created}",
        "Sources": "; ".join(map(find_citation, method)),
    }
    return Section("Provenance", [{name: said for name, said in entries.items() if said}])
