"""Strips: what is drawn along an axis as inline SVG, however many readings there are.

The drawing area is stretched to the width of the page and the numbers at its edges are not: they
stand in strips of their own, at percentages.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from agonic.arrays import Array, Mask
from agonic.report.axes import BINS, Axis, Columns, down, right
from agonic.report.digits import count, group_digits, quantity
from agonic.report.markup import Markup, element


def points(across: Array, below: Array) -> str:
    """Points as a path has them."""
    return "L".join(f"{r:.1f} {d:.0f}" for r, d in zip(across, below, strict=True))


def path(d: str, name: str, **attributes: str | float) -> Markup:
    """A path of a class that the style sheet knows."""
    return element("path", d=d, class_=name, **attributes)


def dots(x: Axis, y: Axis, across: Array, along: Array, name: str) -> Markup:
    """A dot at each place."""
    places = zip(right(x, across), down(y, along), strict=True)
    return path("".join(f"M{a:.0f} {b:.0f}h0" for a, b in places), name)


def area(x: Axis, y: Axis, across: Array, low: Array, high: Array, name: str) -> Markup:
    """What lies between two curves."""
    there = points(right(x, across), down(y, high))
    back = points(right(x, across[::-1]), down(y, low[::-1]))
    return path(f"M{there}L{back}Z", name)


def curve(x: Axis, y: Axis, across: Array, along: Array, name: str) -> Markup:
    """A line through points."""
    return path(f"M{points(right(x, across), down(y, along))}", name)


def line(columns: Columns, y: Axis, values: Array, name: str) -> Markup:
    """A line through one value a column, broken where there are no readings or a NaN stands."""
    at = down(y, values)
    parts = (
        f"M{points(columns.right[part], at[part])}"
        for whole in columns.stretches()
        for part in _known(at, whole)
    )
    return path("".join(parts), name)


def _known(values: Array, part: slice) -> Iterator[slice]:
    """Runs within a part in which no value is a NaN."""
    known = np.concatenate([[False], np.isfinite(values[part]), [False]])
    edges = (np.flatnonzero(known[1:] != known[:-1]) + part.start).tolist()
    yield from map(slice, edges[::2], edges[1::2])


def band(columns: Columns, y: Axis, low: Array, high: Array, name: str) -> Markup:
    """A band between two values a column, broken where there are no readings or a NaN stands."""
    top, foot = down(y, high), down(y, low)
    parts = (
        f"M{points(columns.right[part], top[part])}"
        f"L{points(columns.right[part][::-1], foot[part][::-1])}Z"
        for whole in columns.stretches()
        for part in _known(top + foot, whole)
    )
    return path("".join(parts), name)


def spread(columns: Columns, y: Axis, values: Array, name: str) -> Markup:
    """A band from the least to the largest value of each column."""
    return band(columns, y, columns.least(values), columns.largest(values), name)


def has_enough(readings: int, columns: int = BINS) -> bool:
    """Whether the columns hold so many readings that the middle two thirds mean something."""
    return readings >= 5 * columns


def residuals(columns: Columns, y: Axis, values: Array) -> list[Markup]:
    """Least to largest, the middle two thirds where there are enough readings, and the median."""
    low, middle, high = columns.percentiles(values, (16.0, 50.0, 84.0))
    enough = has_enough(len(values), columns.most)
    return [
        spread(columns, y, values, "range"),
        *([band(columns, y, low, high, "middle")] if enough else []),
        level(y, 0.0, "zero"),
        line(columns, y, middle, "mean"),
    ]


def level(y: Axis, value: float, name: str) -> Markup:
    """A line across the whole strip."""
    return path(f"M0 {float(down(y, np.array(value))):.0f}H1000", name)


def mark_rows(columns: Columns, rows: Mask, name: str) -> Markup:
    """A bar along the foot under the columns that consist mostly of these rows."""
    inside = columns.mean(rows.astype(np.float64)) > 0.5
    first, last = columns.edges()
    bars = (f"M{a:.1f} 990H{b:.1f}" for a, b in zip(first[inside], last[inside], strict=True))
    return path("".join(bars), name)


def arrows(columns: Columns, y: Axis, values: Array) -> list[Markup]:
    """Arrows at the edges over the columns in which values lie beyond the axis, one a run."""
    return [
        *_arrows(columns, columns.largest(values) > y.high, "▲", "0.8em"),
        *_arrows(columns, columns.least(values) < y.low, "▼", "100%"),
    ]


def _arrows(columns: Columns, beyond: Mask, sign: str, at: str) -> list[Markup]:
    """One arrow over each run of columns, of more runs than can be told apart only the first of
    those that stand together."""
    where = columns.right[beyond]
    if not len(where):
        return []
    apart = max(1000.0 / 24, 2000.0 / columns.most)
    ends = np.flatnonzero(np.diff(where) > apart)
    first, last = where[np.r_[0, ends + 1]], where[np.r_[ends, len(where) - 1]]
    return [
        element("text", sign, x=f"{(a + b) / 20:.1f}%", y=at)
        for a, b in zip(first, last, strict=True)
    ]


def robust_limit(values: Array, least: float, weights: Array | None = None) -> float:
    """Half the height of a strip about zero: what counted is inside, gross outliers are not. The
    99.5th percentile of what counted, but never less than `least`, nor more than twelve times the
    median distance from zero (eight standard deviations of a normal distribution)."""
    counted = values if weights is None or not weights.any() else values[weights > 0]
    away = np.abs(counted)
    if not len(away):
        return least
    reach = 1.1 * float(np.percentile(away, 99.5))
    return max(least, min(reach, 1.1 * 12.0 * float(np.median(away))))


def beyond_words(values: Array, limit: float, unit: str) -> str:
    """How many values lie outside ±limit, and how far the farthest is; nothing where none does."""
    outside = np.abs(values) > limit
    n = int(np.count_nonzero(outside))
    if n == 0:
        return ""
    farthest = float(values[int(np.argmax(np.abs(values)))])
    lie = "lies" if n == 1 else "lie"
    return (
        f"{count(n, 'reading')} {lie} beyond the edges (arrows), the farthest at "
        f"{quantity(farthest, unit)}."
    )


def plot(
    x: Axis,
    y: Axis,
    layers: Sequence[Markup],
    label: str,
    signs: Sequence[Markup] = (),
    kind: str = "",
) -> Markup:
    """A strip: the area, the ticks at its left and foot, and signs that are not stretched."""
    left, foot = y.ticks(), x.ticks()
    lines = [
        *(path(f"M0 {at:.0f}H1000", "grid") for at in down(y, left)),
        *(path(f"M{at:.0f} 0V1000", "grid") for at in right(x, foot)),
    ]
    beyond = [element("svg", *signs, class_="beyond", aria_hidden="true")] if signs else []
    return element(
        "div",
        element("p", y.label, class_="axis axis-y"),
        element("svg", *_tick_texts("y", y, left), class_="ticks-y", aria_hidden="true"),
        element(
            "svg",
            *lines,
            *layers,
            class_="area",
            viewBox="0 0 1000 1000",
            preserveAspectRatio="none",
            role="img",
            aria_label=label,
        ),
        *beyond,
        element("svg", *_tick_texts("x", x, foot), class_="ticks-x", aria_hidden="true"),
        element("p", x.label, class_="axis axis-x"),
        class_=f"plot {kind}".strip(),
        data_clock=None if x.clock is None else f"{x.clock[0]:.6g},{x.clock[1]:.6g}",
    )


def _tick_texts(coordinate: str, axis: Axis, ticks: Array) -> list[Markup]:
    step = ticks[1] - ticks[0] if len(ticks) > 1 else max(abs(ticks[0]), 1.0)
    steps = ticks if axis.logarithmic else np.full(len(ticks), step)
    decimals = np.maximum(0, -np.floor(np.log10(steps) + 1e-9).astype(int)).tolist()
    places = (down if coordinate == "y" else right)(axis, ticks)
    return [
        element("text", group_digits(float(tick), digits), **{coordinate: f"{place / 10:.1f}%"})
        for tick, digits, place in zip(ticks, decimals, places, strict=True)
    ]


def caption(name: str, drawn: Markup, keys: dict[str, str] | None = None, note: str = "") -> Markup:
    """A strip as a figure with its name, the words of its colours, and a note."""
    legend = (
        element("span", element("i", class_=f"key {key}"), words)
        for key, words in (keys or {}).items()
    )
    words = element(
        "figcaption",
        element("strong", name),
        element("p", *legend, class_="legend") if keys else "",
        element("p", note, class_="note-line") if note else "",
    )
    return element("figure", words, drawn, class_="strip")
