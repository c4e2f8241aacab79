"""The chart of a deviation card as SVG: before, after, the band of the curve, and the limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array
from agonic.calibration.deviation import POINTS, Deviation, name_heading
from agonic.headings.deviation.card import LIMITS, judge_size
from agonic.headings.deviation.fit import DeviationFit
from agonic.report.axes import Axis
from agonic.report.markup import Markup, element
from agonic.report.page_file import read_static

WIDTH, LEFT, RIGHT = 760.0, 64.0, 112.0
_CIRCLE_DEG = np.arange(0.0, 361.0, 2.0)


@dataclass(frozen=True)
class Layout:
    """How a chart is laid out: its pixels, the name of its lower panel, how many dots and headings.

    Where there is no margin at the right, the limits are named inside.
    """

    name: str
    width: float
    left: float
    right: float
    after: str
    most_dots: int
    step_deg: int


LEAVES = "After: what the card leaves, with the 95 % band of the curve"
WIDE = Layout("wide", WIDTH, LEFT, RIGHT, LEAVES, 1500, 45)
NARROW = Layout("narrow", 400.0, 54.0, 20.0, "After: what is left, and its 95 % band", 500, 90)


class Panel:
    """One of the two areas: the pixels it takes and the deviations it shows."""

    def __init__(self, layout: Layout, top: float, height: float, largest: float) -> None:
        self.layout, self.top, self.height = layout, top, height
        self.axis = Axis("", -largest, largest)
        self.left, self.end = layout.left, layout.width - layout.right

    def right(self, heading_deg: Array) -> Array:
        """Pixels from the left of headings."""
        return np.asarray(self.left + (self.end - self.left) * heading_deg / 360.0)

    def down(self, deviation_deg: Array) -> Array:
        """Pixels from the top of deviations; east is up."""
        return np.asarray(self.top + self.height * (1 - self.axis.share(deviation_deg)))


def draw_chart(
    result: Deviation | DeviationFit, layout: Layout = WIDE, **attributes: str
) -> Markup:
    """The chart as an SVG element; its colours come from card_chart.css."""
    card = result.calibration if isinstance(result, DeviationFit) else result
    heading, residuals = _dots(result, layout.most_dots)
    curve = card.at(_CIRCLE_DEG)
    band = np.zeros_like(curve) if card.covariance is None else card.band_at(_CIRCLE_DEG)
    measured = card.at(heading) + residuals
    before = Panel(layout, 34.0, 250.0, _largest(curve, measured, cap=180.0))
    after = Panel(layout, 344.0, 150.0, _largest(band, residuals, cap=30.0))
    parts = [
        *_frame(before, "Before: deviation of the compass"),
        _band(before, curve - band, curve + band),
        _line(before, curve, "curve"),
        _points(before, heading, measured),
        *_limit_names(before),
        *_frame(after, layout.after),
        _band(after, -band, band),
        _points(after, heading, residuals),
        *_limit_names(after),
        *_rose(after),
    ]
    return element(
        "svg",
        *parts,
        class_=f"card-chart {layout.name}",
        viewBox=f"0 0 {layout.width:g} 548",
        role="img",
        aria_label=judge_size(card),
        **attributes,
    )


def draw_picture(result: Deviation | DeviationFit) -> str:
    """The chart as a file of its own, dark and light, which any program that draws SVG can show.

    >>> draw_picture(Deviation(coefficients=[2.0, 0, 0, 0, 0])).startswith("<svg xmlns=")
    True
    """
    drawn = draw_chart(result, width=f"{WIDTH:g}", height="548")
    style = element("style", Markup(read_static("card_chart.css")))
    ground = element("rect", width="100%", height="100%", class_="paper")
    inside = drawn.partition(">")
    return f'<svg xmlns="http://www.w3.org/2000/svg"{inside[0][4:]}>{style}{ground}{inside[2]}\n'


def _dots(result: Deviation | DeviationFit, most: int) -> tuple[Array, Array]:
    """Headings and residuals of the readings that counted, at most so many of them."""
    if not isinstance(result, DeviationFit):
        return np.empty(0), np.empty(0)
    used = np.flatnonzero(result.weights > 0)
    used = used[:: max(1, -(-len(used) // most))]
    return result.compass_deg[used], result.residuals_deg[used]


def _largest(*shown: Array, cap: float) -> float:
    """What the panel must reach: everything shown, and the limits."""
    reach = max(float(np.abs(values).max(initial=0.0)) for values in shown)
    return min(1.08 * max(reach, 1.12 * LIMITS[-1][0]), cap)


def _text(words: str, kind: str, x: float, y: float, anchor: str | None = None) -> Markup:
    return element("text", words, class_=kind, x=x, y=y, text_anchor=anchor)


def _frame(panel: Panel, title: str) -> list[Markup]:
    """Title, grid, the numbers at the left, and lines at the limits."""
    ticks = panel.axis.ticks(8 if panel.height > 200 else 4)
    across = [f"M{panel.left:g} {at:.1f}H{panel.end:g}" for at in panel.down(ticks)]
    step = float(panel.layout.step_deg)
    along = [
        f"M{x:.1f} {panel.top:g}v{panel.height:g}" for x in panel.right(np.arange(0, 361, step))
    ]
    return [
        _text(title, "title", panel.left, panel.top - 12),
        element("path", d="".join([*across, *along]), class_="grid"),
        _level(panel, "zero", 0.0),
        *(
            _text(_side(float(tick)), "tick", panel.left - 8, round(float(y) + 4, 1), "end")
            for tick, y in zip(ticks, panel.down(ticks), strict=True)
        ),
        *(_level(panel, _name_limit(name), limit, -limit) for limit, name in LIMITS),
    ]


def _level(panel: Panel, kind: str, *deviations_deg: float) -> Markup:
    """Lines across a panel."""
    at = panel.down(np.array(deviations_deg))
    path = "".join(f"M{panel.left:g} {y:.1f}H{panel.end:g}" for y in at)
    return element("path", d=path, class_=kind)


def _name_limit(name: str) -> str:
    return "limit " + name.replace(" ", "-")


def _side(deviation_deg: float) -> str:
    """A tick of the deviation: 5° E.

    >>> _side(-2.5), _side(0.0)
    ('2.5° W', '0°')
    """
    side = " E" if deviation_deg > 0 else " W" if deviation_deg < 0 else ""
    return f"{abs(deviation_deg):g}°{side}"


def _limit_names(panel: Panel) -> list[Markup]:
    """The limits by name, once each: in the margin, or, where there is none, on either side of
    their lines."""
    beside, close = panel.layout.right > 60.0, panel.height > 200
    shifts = (9.0 if close else 4.0, 4.0) if beside else (14.0, -5.0)
    x, anchor = (panel.end + 6, None) if beside else (panel.end - 4, "end")
    parts = []
    for (limit, name), shift in zip(LIMITS, shifts, strict=True):
        y = round(float(panel.down(np.array([limit]))[0]) + shift, 1)
        parts.append(_text(f"{limit:g}° {name}", _name_limit(name), x, y, anchor))
    return parts


def _rose(panel: Panel) -> list[Markup]:
    """Headings along the foot."""
    foot = panel.top + panel.height
    parts = [_text("what the compass reads", "tick", panel.end, foot + 50, "end")]
    for heading in range(0, 361, panel.layout.step_deg):
        x = round(float(panel.right(np.array(float(heading)))), 1)
        parts.append(_text(f"{heading % 360:03d}°", "tick degrees", x, foot + 17, "middle"))
        parts.append(_text(POINTS[heading % 360 * 2 // 45], "point", x, foot + 32, "middle"))
    return parts


def _line(panel: Panel, values: Array, name: str) -> Markup:
    """A curve round the circle, broken where it wraps."""
    x, y = panel.right(_CIRCLE_DEG), panel.down(values)
    jumps = np.append(False, np.abs(np.diff(values)) > 180.0)
    steps = (
        f"{'M' if j or k == 0 else 'L'}{a:.1f} {b:.1f}"
        for k, (a, b, j) in enumerate(zip(x, y, jumps, strict=True))
    )
    return element("path", d="".join(steps), class_=name)


def _band(panel: Panel, low: Array, high: Array) -> Markup:
    x = panel.right(_CIRCLE_DEG)
    there = _join_points(x, panel.down(high))
    back = _join_points(x[::-1], panel.down(low)[::-1])
    return element("path", d=f"M{there}L{back}Z", class_="band")


def _join_points(right: Array, down: Array) -> str:
    return "L".join(f"{x:.1f} {y:.1f}" for x, y in zip(right, down, strict=True))


def _points(panel: Panel, heading: Array, values: Array) -> Markup:
    """Dots as one path; few of them are drawn larger and are named for those who cannot see."""
    places: Sequence[tuple[float, float]] = list(
        zip(panel.right(heading % 360.0), panel.down(values), strict=True)
    )
    name = "dots few" if len(places) <= 72 else "dots"
    said = ", ".join(
        f"{name_heading(float(h))} {v:+.1f}°" for h, v in zip(heading, values, strict=True)
    )
    return element(
        "path",
        element("title", said) if name == "dots few" else "",
        d="".join(f"M{x:.1f} {y:.1f}h0" for x, y in places),
        class_=name,
    )
