"""The chart of a deviation card as SVG: before, after, the band of the curve, and the limits."""

from __future__ import annotations

from typing import NamedTuple

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


class Layout(NamedTuple):
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
    """One of the two areas: the pixels it takes, the deviations it shows, and what is drawn."""

    def __init__(self, layout: Layout, top: float, height: float, *shown: Array, cap: float):
        reach = max(1.12 * LIMITS[-1][0], *(float(np.abs(v).max(initial=0.0)) for v in shown))
        largest = min(1.08 * reach, cap)
        self.layout, self.top, self.height = layout, top, height
        self.axis = Axis("", -largest, largest)
        self.left, self.end = layout.left, layout.width - layout.right
        self.parts: list[Markup] = []

    def right(self, heading_deg: Array) -> Array:
        """Pixels from the left of headings."""
        return np.asarray(self.left + (self.end - self.left) * heading_deg / 360.0)

    def down(self, deviation_deg: Array) -> Array:
        """Pixels from the top of deviations; east is up."""
        return np.asarray(self.top + self.height * (1 - self.axis.share(deviation_deg)))

    def draw_path(self, d: str, kind: str, inside: Markup | str = "") -> None:
        """A path of a class that the style sheet knows."""
        self.parts.append(element("path", inside, d=d, class_=kind))

    def write(self, words: str, kind: str, x: float, y: float, anchor: str | None = None) -> None:
        """Words at a place."""
        self.parts.append(element("text", words, class_=kind, x=x, y=y, text_anchor=anchor))

    def draw_levels(self, kind: str, *deviations_deg: float) -> None:
        """Lines across."""
        at = self.down(np.array(deviations_deg))
        self.draw_path("".join(f"M{self.left:g} {y:.1f}H{self.end:g}" for y in at), kind)

    def draw_frame(self, title: str) -> None:
        """Title, grid, the numbers at the left, and lines at the limits."""
        ticks = self.axis.ticks(8 if self.height > 200 else 4)
        across = [f"M{self.left:g} {at:.1f}H{self.end:g}" for at in self.down(ticks)]
        at = self.right(np.arange(0, 361, float(self.layout.step_deg)))
        along = [f"M{x:.1f} {self.top:g}v{self.height:g}" for x in at]
        self.write(title, "title", self.left, self.top - 12)
        self.draw_path("".join([*across, *along]), "grid")
        self.draw_levels("zero", 0.0)
        for tick, y in zip(ticks.tolist(), self.down(ticks), strict=True):
            side = " E" if tick > 0 else " W" if tick < 0 else ""
            words = f"{abs(tick):g}°{side}"
            self.write(words, "tick", self.left - 8, round(float(y) + 4, 1), "end")
        for limit, name in LIMITS:
            self.draw_levels(_name_limit(name), limit, -limit)

    def draw_band(self, low: Array, high: Array) -> None:
        """What lies between two curves."""
        x = self.right(_CIRCLE_DEG)
        there = _join_points(x, self.down(high))
        self.draw_path(f"M{there}L{_join_points(x[::-1], self.down(low)[::-1])}Z", "band")

    def draw_curve(self, values: Array) -> None:
        """A curve round the circle, broken where it wraps."""
        x, y = self.right(_CIRCLE_DEG), self.down(values)
        jumps = np.flatnonzero(np.abs(np.diff(values)) > 180.0) + 1
        parts = zip(np.split(x, jumps), np.split(y, jumps), strict=True)
        self.draw_path("".join(f"M{_join_points(a, b)}" for a, b in parts), "curve")

    def draw_dots(self, heading: Array, values: Array) -> None:
        """Dots as one path; few of them are larger, and named for those who cannot see."""
        places = zip(self.right(heading % 360.0), self.down(values), strict=True)
        few = len(heading) <= 72
        named = zip(heading.tolist(), values, strict=True)
        said = ", ".join(f"{name_heading(h)} {v:+.1f}°" for h, v in named) if few else ""
        d = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in places)
        self.draw_path(d, "dots few" if few else "dots", element("title", said) if few else "")

    def name_limits(self) -> None:
        """The limits by name, once each: in the margin, or, where there is none, on either side of
        their lines."""
        beside, close = self.layout.right > 60.0, self.height > 200
        shifts = (9.0 if close else 4.0, 4.0) if beside else (14.0, -5.0)
        x, anchor = (self.end + 6, None) if beside else (self.end - 4, "end")
        for (limit, name), shift in zip(LIMITS, shifts, strict=True):
            y = round(float(self.down(np.array([limit]))[0]) + shift, 1)
            self.write(f"{limit:g}° {name}", _name_limit(name), x, y, anchor)

    def draw_rose(self) -> None:
        """Headings along the foot."""
        foot = self.top + self.height
        self.write("what the compass reads", "tick", self.end, foot + 50, "end")
        for heading in range(0, 361, self.layout.step_deg):
            x = round(float(self.right(np.array(float(heading)))), 1)
            self.write(f"{heading % 360:03d}°", "tick degrees", x, foot + 17, "middle")
            self.write(POINTS[heading % 360 * 2 // 45], "point", x, foot + 32, "middle")


def draw_chart(
    result: Deviation | DeviationFit, layout: Layout = WIDE, **attributes: str
) -> Markup:
    """The chart as an SVG element; its colours come from card_chart.css."""
    card, heading, residuals = result, np.empty(0), np.empty(0)
    if isinstance(result, DeviationFit):
        card, used = result.calibration, np.flatnonzero(result.weights > 0)
        used = used[:: max(1, -(-len(used) // layout.most_dots))]
        heading, residuals = result.compass_deg[used], result.residuals_deg[used]
    assert isinstance(card, Deviation)
    curve = card.at(_CIRCLE_DEG)
    band = np.zeros_like(curve) if card.covariance is None else card.band_at(_CIRCLE_DEG)
    measured = card.at(heading) + residuals
    before = Panel(layout, 34.0, 250.0, curve, measured, cap=180.0)
    after = Panel(layout, 344.0, 150.0, band, residuals, cap=30.0)
    before.draw_frame("Before: deviation of the compass")
    before.draw_band(curve - band, curve + band)
    before.draw_curve(curve)
    before.draw_dots(heading, measured)
    before.name_limits()
    after.draw_frame(layout.after)
    after.draw_band(-band, band)
    after.draw_dots(heading, residuals)
    after.name_limits()
    after.draw_rose()
    return element(
        "svg",
        *before.parts,
        *after.parts,
        class_=f"card-chart {layout.name}",
        viewBox=f"0 0 {layout.width:g} 548",
        role="img",
        aria_label=judge_size(card),
        **attributes,
    )


def draw_picture(result: Deviation | DeviationFit) -> str:
    """The chart as a file of its own, dark and light, which any program that draws SVG can show."""
    drawn = draw_chart(result, width=f"{WIDTH:g}", height="548")
    style = element("style", Markup(read_static("card_chart.css")))
    ground = element("rect", width="100%", height="100%", class_="paper")
    inside = drawn.partition(">")
    return f'<svg xmlns="http://www.w3.org/2000/svg"{inside[0][4:]}>{style}{ground}{inside[2]}\n'


def _name_limit(name: str) -> str:
    return "limit " + name.replace(" ", "-")


def _join_points(right: Array, down: Array) -> str:
    return "L".join(f"{x:.1f} {y:.1f}" for x, y in zip(right, down, strict=True))
