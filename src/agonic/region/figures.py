"""A region as a map from above: strength of the field, readings, and where to measure next."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.region.result import FieldAt, FieldMap
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


def draw_map(found: FieldMap) -> list[Markup]:
    """The strength of the field and its standard error at half height, y to the right of x as in
    the region's own axes: x up, y to the right."""
    corners = np.stack([found.low, found.high])[:, [1, 0]]
    x, y = fit_axes(("y, m", "x, m"), corners, margin=0.04)
    nodes, shape = list_nodes(x, y, 20)
    inside = ((nodes >= corners[0] - 1e-9) & (nodes <= corners[1] + 1e-9)).all(axis=1)
    height = float(found.low[2] + found.high[2]) / 2
    at = np.column_stack([nodes[:, 1], nodes[:, 0], np.full(len(nodes), height)])
    here = found.at(at[inside])
    strength, sd = (np.full(len(nodes), np.nan) for _ in range(2))
    strength[inside], sd[inside] = here.magnitude, np.sqrt(np.square(here.sd).sum(axis=1))
    title = f"at z = {height:.2f} m"
    return [
        _draw(
            found,
            (x, y),
            strength.reshape(shape),
            (f"Strength {title}, nT", "strength"),
            at,
            here,
            inside,
        ),
        _draw(
            found,
            (x, y),
            sd.reshape(shape),
            (f"Standard error {title}, nT", "standard error of the vector"),
        ),
    ]


def _draw(
    found: FieldMap,
    axes: tuple[Axis, Axis],
    values: Array,
    words: tuple[str, str],
    at: Array | None = None,
    here: FieldAt | None = None,
    inside: Array | None = None,
) -> Markup:
    """One map with lines of equal value, and arrows of the level field where it is given."""
    x, y = axes
    layers, labels = draw_contours(values, _choose_levels(values).tolist(), "")
    keys = {"contour": words[1]}
    if at is not None and here is not None and inside is not None:
        layers.append(draw_lines(_list_arrows(axes, at[inside], here.field), "lead"))
        keys["lead"] = "level part of what differs from the mean"
    left = found.readings.position[:, [1, 0]]
    layers.append(draw_dots(locate(x, y, left), "dots"))
    places = found.next_places[:, [1, 0]]
    layers.append(draw_dots(locate(x, y, places), "dots wanted"))
    names = _name_places(places)
    labels += [label(name, locate(x, y, place), "chosen") for name, place in names]
    keys |= {"dots": "readings", "wanted": "measure next"}
    return caption(words[0], plot(x, y, layers, words[0], labels, "contours"), keys)


def _name_places(places: Array) -> list[tuple[str, Array]]:
    """Places (k, 2) with their numbers; those above each other share a label."""
    together: dict[tuple[float, float], list[str]] = {}
    for k, (x, y) in enumerate(places.round(6).tolist(), start=1):
        together.setdefault((x, y), []).append(str(k))
    return [(", ".join(names), np.array(place)) for place, names in together.items()]


def _choose_levels(values: Array) -> Array:
    """Five levels between the least and the largest value, round ones."""
    low, high = np.percentile(values[np.isfinite(values)], (2, 98))
    return Axis("", float(low), float(high)).ticks(5)


def _list_arrows(axes: tuple[Axis, Axis], at: Array, field: Array) -> Array:
    """Pieces (n, 2, 2) from places along what differs from the mean, the longest one a twelfth of
    the map."""
    x, y = axes
    apart = (field - field.mean(axis=0))[:, [1, 0]]
    longest = max(float(np.linalg.norm(apart, axis=1).max()), 1e-9)
    step = (x.high - x.low) / 12 / longest
    chosen = np.arange(0, len(at), 3)
    start = at[chosen][:, [1, 0]]
    return np.stack([locate(x, y, start), locate(x, y, start + step * apart[chosen])], axis=1)
