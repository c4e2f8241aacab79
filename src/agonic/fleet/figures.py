"""Figures of a fleet: histograms, biases against each other, and what goes with them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agonic.arrays import Array, Mask
from agonic.maths.estimation.robust.robust_line import Line
from agonic.population.peers import Peers
from agonic.report.axes import Axis
from agonic.report.digits import count, quantity
from agonic.report.figure import Panel
from agonic.report.marks import curve, dots, histogram, span, upright
from agonic.report.markup import Markup, element, markup
from agonic.report.section import aside

BINS = 40
MOST_DOTS = 1500
"""Points that are drawn where the page's script does not run."""


def make_axis(values: Array, label: str, beyond: float = 1.5) -> Axis:
    """An axis over the bulk of the values: a few that lie far out do not squeeze the others. It
    goes no further than `beyond` times the width of the inner eight tenths past them."""
    low, first, last, high = np.percentile(values, (0, 10, 90, 100))
    wide = max(last - first, 1e-3 * max(abs(first), abs(last)), 1e-12)
    low, high = max(low, first - beyond * wide), min(high, last + beyond * wide)
    margin = 0.06 * max(high - low, wide)
    return Axis(label, float(low - margin), float(high + margin))


def draw_histogram(
    values: Array,
    label: str,
    column: str,
    group: int,
    usual: tuple[float, float] | None,
    size: float = 1.0,
) -> Markup:
    """How often each value occurs; what lies beyond the axis is in its outermost bars. Values are
    `size` times those of the column. `usual` are centre and spread of the population: a line, and a
    band of one spread to each side."""
    x = make_axis(values, label)
    counts, edges = np.histogram(np.clip(values, x.low, x.high), BINS, (x.low, x.high))
    y = Axis("calibrations", 0.0, 1.06 * float(max(counts.max(), 3)))  # whole numbers beside it
    marks = [histogram("bars", counts, edges)]
    if usual is not None:
        centre, spread = usual
        band = span("usual", centre - spread, centre + spread)
        marks = [band, *marks, upright("centre", centre)]
    name = f"Histogram of {label} of {count(len(values), 'calibration')}"
    drawn = Panel(x=x, y=y, marks=marks, said=name, kind="short")
    return _make_selectable(drawn, "histogram", group, (column,), name, size)


def draw_scatter(
    x: Axis,
    y: Axis,
    across: Array,
    along: Array,
    noted: Mask,
    lines: Sequence[tuple[Line, float, float]] = (),
    kind: str = "short",
) -> Panel:
    """Points, those that stand out over the others; lines through them from x to x."""
    plain = np.flatnonzero(~noted)
    plain = plain[:: 1 + len(plain) // MOST_DOTS]
    inside = (across >= x.low) & (across <= x.high) & (along >= y.low) & (along <= y.high)
    marked = np.flatnonzero(noted)
    marked = marked[:: 1 + len(marked) // (MOST_DOTS // 5)]
    marks = []
    for rows, name in ((plain, "dots"), (marked, "odd-dots")):
        rows = rows[inside[rows]]
        marks.append(dots(name, across[rows], along[rows]))
    for line, *ends in lines:
        marks.append(curve("centre", ends, line.at(np.array(ends))))
    name = f"{y.label} against {x.label}, {count(len(across), 'calibration')}"
    return Panel(x=x, y=y, marks=marks, said=name, kind=kind)


def draw_biases(group: Peers, number: int, bias: Array, noted: Mask, unit: str) -> Markup:
    """Bias x against y and z against y, on axes of the same length."""
    axes = [make_axis(bias[:, k], f"bias {name}, {unit}", 4.0) for k, name in enumerate("xyz")]
    half = max(axis.high - axis.low for axis in axes) / 2
    middles = [(axis.low + axis.high) / 2 for axis in axes]
    x, y, z = (Axis(a.label, m - half, m + half) for a, m in zip(axes, middles, strict=True))
    outside = np.zeros(len(bias), dtype=bool)
    for values, axis in zip(bias.T, (x, y, z), strict=True):
        outside |= (values < axis.low) | (values > axis.high)
    beyond = int(outside.sum())
    said = f"{count(beyond, 'calibration')} beyond the axes." if beyond else ""
    drawn = element(
        "div",
        *(
            _make_selectable(
                draw_scatter(one, y, bias[:, k], bias[:, 1], noted, kind="tall"),
                "scatter",
                number,
                (f"bias_{'xyz'[k]}", "bias_y"),
                f"bias {'xyz'[k]} against y",
            )
            for k, one in ((0, x), (2, z))
        ),
        class_="pair",
    )
    return markup(drawn, aside(said))


def describe_usual(usual: tuple[float, float] | None, unit: str) -> str:
    """Centre and spread of a population in words."""
    if usual is None or not np.isfinite(usual).all():
        return ""
    centre, spread = usual
    shown = quantity(centre, unit, 4 if abs(centre) > 10 * spread else 3)
    return f"{shown}, sensors differ by ±{quantity(spread, unit, 2)}"


def _make_selectable(
    drawn: Panel,
    kind: str,
    group: int,
    columns: tuple[str, ...],
    name: str,
    size: float = 1.0,
) -> Markup:
    """A figure that the page's script can select from: its columns and the ranges of its axes."""
    said = element("p", class_="picked aside", aria_live="polite")
    return element(
        "div",
        drawn.to_html(),
        said,
        class_=f"live {kind}",
        data_kind=kind,
        data_group=group,
        data_columns=" ".join(columns),
        data_bins=BINS,
        data_name=name,
        data_size=size,
        data_x=f"{drawn.x.low!r} {drawn.x.high!r}",
        data_y=f"{drawn.y.low!r} {drawn.y.high!r}",
    )
