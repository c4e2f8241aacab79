"""A region as a map from above: strength of the field, readings, and where to measure next."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.region.result import FieldMap
from agonic.report.axes import Axis
from agonic.report.contours import (
    draw_contours,
    draw_dots,
    draw_lines,
    fit_axes,
    label,
    list_nodes,
    locate,
)
from agonic.report.markup import Markup
from agonic.report.strips import caption, plot

KEYS = {
    "contour": "lines of equal value",
    "lead": "level part of what differs from the mean",
    "dots": "readings at any height",
    "wanted": "measure next",
}


def draw_map(found: FieldMap) -> list[Markup]:
    """The strength of the field, and its standard error, at half height: x up, y to the right."""
    corners = np.stack([found.low, found.high])[:, [1, 0]]
    x, y = fit_axes(("y, m", "x, m"), corners, margin=0.04)
    nodes, shape = list_nodes(x, y, 20)
    inside = ((nodes >= corners[0]) & (nodes <= corners[1])).all(axis=1)
    height = float(found.low[2] + found.high[2]) / 2
    here = found.at(np.column_stack([nodes[inside][:, ::-1], np.full(inside.sum(), height)]))
    apart = (here.field - here.field.mean(axis=0))[:, [1, 0]]
    longest = float(np.linalg.norm(apart, axis=1).max()) or 1.0
    arrows = np.stack([nodes[inside], nodes[inside] + (x.high - x.low) / 12 / longest * apart], 1)
    layers = [
        draw_lines(locate(x, y, arrows[::3]), "lead"),
        draw_dots(locate(x, y, found.readings.position[:, [1, 0]]), "dots"),
        draw_dots(locate(x, y, found.next_places[:, [1, 0]]), "dots wanted"),
    ]
    numbers = _number_places((x, y), found.next_places)
    drawn = []
    for title, values in (
        ("Strength", here.magnitude),
        ("Standard error of the vector", np.sqrt(np.square(here.sd).sum(axis=1))),
    ):
        whole = np.full(len(nodes), np.nan)
        whole[inside] = values
        levels = Axis("", float(values.min()), float(np.percentile(values, 98))).ticks(5)
        lines, labels = draw_contours(whole.reshape(shape), levels.tolist(), "")
        name = f"{title} at z = {height:.2f} m, nT"
        made = plot(x, y, [*lines, *layers], name, [*labels, *numbers], "contours")
        drawn.append(caption(name, made, KEYS))
    return drawn


def _number_places(axes: tuple[Axis, Axis], places: Array) -> list[Markup]:
    """Numbers beside places (k, 3); those above each other share a label."""
    together: dict[tuple[float, float], list[str]] = {}
    for k, (x, y, _) in enumerate(places.round(6).tolist(), start=1):
        together.setdefault((y, x), []).append(str(k))
    return [
        label(", ".join(names), locate(*axes, np.array(at)), "chosen")
        for at, names in together.items()
    ]
