"""`Figure`: panels with axes and marks, as inline SVG, however many readings there are.

The drawing area is stretched to the width of the page and the numbers at its edges are not: they
stand in strips of their own, at percentages.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array, Mask
from agonic.report.axes import Axis, down, right
from agonic.report.digits import count, group_digits, quantity
from agonic.report.marks import Mark
from agonic.report.markup import Markup, element


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """Axes and what is drawn on them, in this order: marks, or markup of the drawing area. `said`
    is read out; default: the title of the figure and what its axes are. `signs` are not stretched;
    `kind` is a class of the style sheets."""

    x: Axis
    y: Axis
    marks: Sequence[Mark | Markup]
    said: str = ""
    signs: Sequence[Markup] = ()
    kind: str = ""

    def to_html(self, title: str = "") -> Markup:
        """The panel: its area, the ticks at its left and foot, and its signs."""
        x, y = self.x, self.y
        left, below = y.ticks(), x.ticks()
        lines = [
            *(path(f"M0 {at:.0f}H1000", "grid") for at in down(y, left)),
            *(path(f"M{at:.0f} 0V1000", "grid") for at in right(x, below)),
        ]
        marks = [one for one in self.marks if isinstance(one, Markup) or one.seen]
        drawn = [one if isinstance(one, Markup) else draw(one, x, y) for one in marks]
        spreads = [one for one in marks if isinstance(one, Mark) and one.kind == "spread"]
        signs = [*self.signs, *(sign for one in spreads for sign in draw_arrows(one, x, y))]
        beyond = [element("svg", *signs, class_="beyond", aria_hidden="true")] if signs else []
        return element(
            "div",
            element("p", y.label, class_="axis axis-y"),
            element("svg", *_tick_texts("y", y, left), class_="ticks-y", aria_hidden="true"),
            element(
                "svg",
                *lines,
                *drawn,
                class_="area",
                viewBox="0 0 1000 1000",
                preserveAspectRatio="none",
                role="img",
                aria_label=self.said or f"{title}: {y.label} over {x.label}",
            ),
            *beyond,
            element("svg", *_tick_texts("x", x, below), class_="ticks-x", aria_hidden="true"),
            element("p", x.label, class_="axis axis-x"),
            class_=f"plot {self.kind}".strip(),
            data_clock=None if x.clock is None else f"{x.clock[0]:.6g},{x.clock[1]:.6g}",
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Figure:
    """Panels under a title, with the words of their marks as a legend, and a note. `style` are
    classes of what holds several panels; `above` stands over them."""

    title: str
    panels: Sequence[Panel]
    note: str = ""
    style: str = ""
    above: str = ""

    def to_html(self) -> Markup:
        """The figure with its caption."""
        marks = [one for panel in self.panels for one in panel.marks if isinstance(one, Mark)]
        keys = {one.name.split()[-1]: one.words for one in marks if one.words and one.seen}
        drawn = [panel.to_html(self.title) for panel in self.panels]
        if self.style:
            drawn = [element("div", *drawn, class_=self.style)]
        return caption(self.title, Markup(self.above + "".join(drawn)), keys, self.note)


def figure(title: str, x: Axis, y: Axis, *marks: Mark, note: str = "", kind: str = "") -> Figure:
    """A figure of one panel."""
    return Figure(title=title, panels=[Panel(x=x, y=y, marks=marks, kind=kind)], note=note)


def caption(
    name: str, drawn: Markup, keys: Mapping[str, str] | None = None, note: str = ""
) -> Markup:
    """What is drawn as a figure with its name, the words of its colours, and a note."""
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


# ---- marks as paths ------------------------------------------------------------------------------


def path(d: str, name: str, **attributes: str | float) -> Markup:
    """A path of a class that the style sheet knows."""
    return element("path", d=d, class_=name, **attributes)


def draw(mark: Mark, x: Axis, y: Axis) -> Markup:
    """A mark as a path of the drawing area."""
    return path("".join(_PATHS[mark.kind](x, y, *mark.at)), mark.name)


def _join(across: Array, below: Array) -> str:
    """Points as a path has them."""
    return "L".join(f"{r:.1f} {d:.0f}" for r, d in zip(across, below, strict=True))


def _find_runs(known: Mask) -> Iterator[slice]:
    """Runs without a gap."""
    edges = np.flatnonzero(np.diff(known, prepend=False, append=False)).tolist()
    yield from map(slice, edges[::2], edges[1::2])


def _draw_curve(x: Axis, y: Axis, across: Array, along: Array) -> Iterator[str]:
    r, d = right(x, across), down(y, along)
    return (f"M{_join(r[run], d[run])}" for run in _find_runs(np.isfinite(r + d)))


def _draw_area(x: Axis, y: Axis, across: Array, low: Array, high: Array) -> Iterator[str]:
    r, top, base = right(x, across), down(y, high), down(y, low)
    for run in _find_runs(np.isfinite(r + top + base)):
        yield f"M{_join(r[run], top[run])}L{_join(r[run][::-1], base[run][::-1])}Z"


def _draw_histogram(x: Axis, y: Axis, counts: Array, edges: Array) -> Iterator[str]:
    yield f"M0 1000L{_join(np.repeat(right(x, edges), 2)[1:-1], np.repeat(down(y, counts), 2))}"
    yield "L1000 1000Z"


def _stroke(form: str, *of: Callable[[Axis, Axis, Array], Array]) -> Callable[..., Iterator[str]]:
    """What draws a piece of a form for each place that is known, its numbers by axes."""

    def draw_each(x: Axis, y: Axis, *at: Array) -> Iterator[str]:
        places = np.stack([to(x, y, values) for to, values in zip(of, at, strict=True)], axis=-1)
        return (form.format(*one) for one in places[np.isfinite(places).all(axis=1)].tolist())

    return draw_each


def _across(x: Axis, _: Axis, values: Array) -> Array:
    return right(x, values)


def _below(_: Axis, y: Axis, values: Array) -> Array:
    return down(y, values)


_PATHS: dict[str, Callable[..., Iterator[str]]] = {
    "curve": _draw_curve,
    "area": _draw_area,
    "spread": _draw_area,
    "histogram": _draw_histogram,
    "dots": _stroke("M{:.0f} {:.0f}h0", _across, _below),
    "whiskers": _stroke("M{:.1f} {:.1f}V{:.1f}", _across, _below, _below),
    "level": _stroke("M0 {:.0f}H1000", _below),
    "upright": _stroke("M{:.1f} 0V1000", _across),
    "span": _stroke("M{0:.1f} 0H{1:.1f}V1000H{0:.1f}Z", _across, _across),
    "bars": _stroke("M{0:.1f} {2:.1f}H{1:.1f}V{3:.1f}H{0:.1f}Z", _across, _across, _below, _below),
    "foot": _stroke("M{:.1f} 990H{:.1f}", _across, _across),
}
"""How each kind of mark is drawn."""


def _tick_texts(coordinate: str, axis: Axis, ticks: Array) -> list[Markup]:
    step = ticks[1] - ticks[0] if len(ticks) > 1 else max(abs(ticks[0]), 1.0)
    steps = ticks if axis.logarithmic else np.full(len(ticks), step)
    decimals = np.maximum(0, -np.floor(np.log10(steps) + 1e-9).astype(int)).tolist()
    places = (down if coordinate == "y" else right)(axis, ticks)
    return [
        element("text", group_digits(float(tick), digits), **{coordinate: f"{place / 10:.1f}%"})
        for tick, digits, place in zip(ticks, decimals, places, strict=True)
    ]


# ---- what lies beyond the axis -------------------------------------------------------------------


def draw_arrows(mark: Mark, x: Axis, y: Axis) -> list[Markup]:
    """Arrows at the edges over where a mark lies beyond the axis, one a run; of more runs than can
    be told apart only the first of those that stand together."""
    across, low, high = mark.at
    drawn = []
    for beyond, sign, at in ((high > y.high, "▲", "0.8em"), (low < y.low, "▼", "100%")):
        where = right(x, across[beyond])
        ends = np.flatnonzero(np.diff(where) > max(1000.0 / 24, 2000.0 / len(across)))
        firsts, lasts = np.r_[0, ends + 1], np.r_[ends, len(where) - 1]
        for first, last in zip(where[firsts], where[lasts], strict=True) if len(where) else ():
            drawn.append(element("text", sign, x=f"{(first + last) / 20:.1f}%", y=at))
    return drawn


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
