"""A region as a map from above: strength of the field, readings, and where to measure next."""

from __future__ import annotations

import numpy as np

from agonic.region.result import FieldMap
from agonic.report.axes import Axis
from agonic.report.contours import draw_map, fit_axes, list_nodes
from agonic.report.markup import Markup

KEYS = {
    "contour": "lines of equal value",
    "lead": "level part of what differs from the mean",
    "dots": "readings at any height",
    "wanted": "measure next",
}


def draw_region(found: FieldMap) -> list[Markup]:
    """The strength of the field, and its standard error, at half height: x up, y to the right."""
    corners = np.stack([found.low, found.high])[:, [1, 0]]
    axes = fit_axes(("y, m", "x, m"), corners, margin=0.04)
    nodes, shape = list_nodes(*axes, 20)
    inside = ((nodes >= corners[0]) & (nodes <= corners[1])).all(axis=1)
    height = float(found.low[2] + found.high[2]) / 2
    here = found.at(np.column_stack([nodes[inside][:, ::-1], np.full(inside.sum(), height)]))
    apart = (here.field - here.field.mean(axis=0))[:, [1, 0]]
    longest = float(np.linalg.norm(apart, axis=1).max()) or 1.0
    ends = nodes[inside] + (axes[0].high - axes[0].low) / 12 / longest * apart
    marks = [
        ("lead", np.stack([nodes[inside], ends], axis=1)[::3]),
        ("dots", found.readings.position[:, [1, 0]]),
        ("dots wanted", found.next_places[:, [1, 0]]),
    ]
    together: dict[tuple[float, float], list[str]] = {}  # those above each other share a name
    for k, (x, y, _) in enumerate(found.next_places.round(6).tolist(), start=1):
        together.setdefault((y, x), []).append(str(k))
    names = [(", ".join(numbers), np.array(at), "chosen") for at, numbers in together.items()]
    drawn = []
    for title, values in (
        ("Strength", here.magnitude),
        ("Standard error of the vector", np.sqrt(np.square(here.sd).sum(axis=1))),
    ):
        whole = np.full(shape, np.nan)
        whole.flat[inside] = values
        levels = Axis("", float(values.min()), float(np.percentile(values, 98))).ticks(5)
        title = f"{title} at z = {height:.2f} m, nT"
        drawn.append(
            draw_map(axes, whole, levels, title=title, keys=KEYS, marks=marks, names=names)
        )
    return drawn
