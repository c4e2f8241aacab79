"""Charts of a network's training as SVG files that stand alone: curves, and the table of nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.network.fit import NetworkChoice, NetworkFit
from agonic.report.axes import Axis
from agonic.report.markup import Markup, element

WIDTH, HEIGHT = 720.0, 360.0
LEFT, RIGHT, TOP, FOOT = 72.0, 24.0, 40.0, 56.0
MOST_POINTS = 1500
COLOURS = ("#1f6feb", "#d1495b", "#2e8b57", "#8a6d3b")

_STYLE = Markup(
    "svg{font:13px system-ui,sans-serif;background:#fff}text{fill:#24292f}"
    ".grid{stroke:#d8dee4;stroke-width:1}.curve{fill:none;stroke-width:1.6}"
    ".limit{stroke:#57606a;stroke-width:1.2;stroke-dasharray:5 4}"
    ".word{paint-order:stroke;stroke:#fff;stroke-width:4}"
)


@dataclass(frozen=True)
class Curve:
    """A named curve: where its points are, and whether they are joined."""

    label: str
    x: ArrayLike
    y: ArrayLike
    dots: bool = False


def chart(
    title: str,
    x_label: str,
    y_label: str,
    curves: Sequence[Curve],
    *,
    logarithmic: bool = False,
    limits: Sequence[tuple[float, str]] = (),
) -> Markup:
    """Curves over common axes; `limits` are level lines with a word, `logarithmic` the height.

    >>> chart("a", "x", "y", [Curve("c", [0, 1], [2, 3])]).startswith("<svg")
    True
    """
    drawn = [(np.asarray(c.x, float), _height(c.y, logarithmic), c) for c in curves]
    levels = [(float(_height([at], logarithmic)[0]), words) for at, words in limits]
    x = _axis(x_label, np.concatenate([at for at, _, _ in drawn]), 0.0)
    heights = np.concatenate([*(h for _, h, _ in drawn), np.array([at for at, _ in levels])])
    y = _axis(y_label, heights, 0.06)
    return element(
        "svg",
        element("style", _STYLE),
        *_grid(x, y, logarithmic),
        *(_curve(x, y, at, h, curve, k) for k, (at, h, curve) in enumerate(drawn)),
        *(_level(y, at, words) for at, words in levels),
        element("text", title, x=LEFT, y=22, font_weight="600"),
        *_legend(curves),
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {WIDTH:g} {HEIGHT:g}",
        role="img",
        aria_label=title,
    )


def training_chart(fit: NetworkFit) -> Markup:
    """The mean square error (scaled) after each epoch of the training."""
    epochs = np.arange(1, len(fit.epochs) + 1)
    curves = [Curve("trained on", epochs, [e.mean_square for e in fit.epochs])]
    unseen = np.array([epoch.held_out for epoch in fit.epochs])
    if np.isfinite(unseen).any():
        curves.append(Curve("held out", epochs[np.isfinite(unseen)], unseen[np.isfinite(unseen)]))
    return chart(
        "Training",
        "epoch",
        "mean square error, scaled",
        curves,
        logarithmic=True,
        limits=[(1e-3, "0.001")],
    )


def table_chart(choice: NetworkChoice) -> Markup:
    """Rms and largest error of unseen readings by hidden nodes, and those of the base."""
    nodes = [row.hidden for row in choice.table]
    curves = [
        Curve("rms of unseen readings", nodes, [row.unseen_rms for row in choice.table], True),
        Curve("largest", nodes, [row.unseen_maximum for row in choice.table], True),
    ]
    based = [(choice.base_rms, "base, rms"), (choice.base_maximum, "base, largest")]
    return chart(
        "Hidden nodes",
        "hidden nodes",
        "error, nT",
        curves,
        logarithmic=True,
        limits=[(value, words) for value, words in based if value is not None],
    )


def _height(values: ArrayLike, logarithmic: bool) -> Array:
    plain = np.asarray(values, dtype=np.float64)
    return np.asarray(np.log10(np.maximum(plain, 1e-300)) if logarithmic else plain)


def _axis(label: str, values: Array, margin: float) -> Axis:
    low, high = float(values.min()), float(values.max())
    room = margin * (high - low) if high > low else 0.5
    return Axis(label, low - room, high + room)


def _right(x: Axis, values: Array) -> Array:
    return np.asarray(LEFT + x.share(values) * (WIDTH - LEFT - RIGHT))


def _down(y: Axis, values: Array) -> Array:
    return np.asarray(TOP + (1.0 - y.share(values)) * (HEIGHT - TOP - FOOT))


def _grid(x: Axis, y: Axis, logarithmic: bool) -> list[Markup]:
    """Lines at round numbers, the numbers, and what the axes show."""
    parts = []
    along, up = x.ticks(), _decades(y) if logarithmic else y.ticks(5)
    for tick, at in zip(along, _right(x, along), strict=True):
        parts.append(_rule(at, at, TOP, HEIGHT - FOOT, "grid"))
        parts.append(_word(f"{tick:g}", at, HEIGHT - FOOT + 18, "middle"))
    for tick, at in zip(up, _down(y, up), strict=True):
        parts.append(_rule(LEFT, WIDTH - RIGHT, at, at, "grid"))
        number = 10.0**tick if logarithmic else tick
        parts.append(_word(f"{float(f'{number:.3g}'):g}", LEFT - 8, at + 4, "end"))
    parts.append(_word(x.label, (LEFT + WIDTH - RIGHT) / 2, HEIGHT - 12, "middle"))
    middle = (TOP + HEIGHT - FOOT) / 2
    turn = f"rotate(-90 16 {middle:g})"
    parts.append(element("text", y.label, x=16, y=middle, text_anchor="middle", transform=turn))
    return parts


def _decades(y: Axis) -> Array:
    """Logarithms of 1, 2 and 5 times powers of ten within the axis; of long axes the powers."""
    powers = np.arange(np.floor(y.low), np.ceil(y.high) + 1)
    steps = np.array([0.0]) if y.high - y.low > 3 else np.log10([1.0, 2.0, 5.0])
    marks = np.sort((powers[:, None] + steps).ravel())
    return np.asarray(marks[(marks >= y.low) & (marks <= y.high)])


def _rule(x1: float, x2: float, y1: float, y2: float, name: str) -> Markup:
    return element("path", d=f"M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}", class_=name)


def _word(text: str, x: float, y: float, anchor: str) -> Markup:
    return element("text", text, x=f"{x:.1f}", y=f"{y:.1f}", text_anchor=anchor, class_="word")


def _level(y: Axis, at: float, words: str) -> Markup:
    height = float(_down(y, np.array([at]))[0])
    return element(
        "g",
        _rule(LEFT, WIDTH - RIGHT, height, height, "limit"),
        _word(words, WIDTH - RIGHT - 4, height - 5, "end"),
    )


def _curve(x: Axis, y: Axis, along: Array, heights: Array, curve: Curve, number: int) -> Markup:
    """The curve; of very many points those that are largest in their stretch."""
    colour = COLOURS[number % len(COLOURS)]
    if len(along) > MOST_POINTS:
        starts = np.linspace(0, len(along), MOST_POINTS, endpoint=False).astype(int)
        along, heights = along[starts], np.maximum.reduceat(heights, starts)
    right, down = _right(x, along), _down(y, heights)
    line = "L".join(f"{r:.1f} {d:.1f}" for r, d in zip(right, down, strict=True))
    dots = [
        element("circle", cx=f"{r:.1f}", cy=f"{d:.1f}", r=4, fill=colour)
        for r, d in zip(right, down, strict=True)
        if curve.dots
    ]
    return element("g", element("path", d=f"M{line}", class_="curve", stroke=colour), *dots)


def _legend(curves: Sequence[Curve]) -> list[Markup]:
    """The names of the curves in their colours, at the right of the title."""
    parts, at = [], WIDTH - RIGHT
    for number, curve in reversed(list(enumerate(curves))):
        colour = COLOURS[number % len(COLOURS)]
        parts.append(
            element(
                "text", curve.label, x=f"{at:.0f}", y=22, text_anchor="end", style=f"fill:{colour}"
            )
        )
        at -= 8.0 * len(curve.label) + 20.0
    return parts
