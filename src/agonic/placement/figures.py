"""A vehicle as a map: its parts, lines of equal heading error, and where magnetometers sit."""

from __future__ import annotations

from itertools import product
from typing import Literal

import numpy as np

from agonic.arrays import Array
from agonic.placement.layout import Region
from agonic.placement.plan import Placement
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

View = Literal["above", "right"]
_AXES = {"above": ("y: right, m", "x: forward, m"), "right": ("x: forward, m", "z: up, m")}
KEYS = {
    "contour": "heading error of one alone, at the depth of the first",
    "allowed": "allowed regions",
    "lead": "currents",
    "chosen": "magnetometers",
}


def draw_view(plan: Placement, view: View) -> Markup:
    """The vehicle from above, forward up, or from its right side, with the heading error of one
    magnetometer alone in the plane through the first place."""
    layout = plan.layout
    regions = np.concatenate([_list_edges(one) for one in layout.regions])
    wires = [np.stack([w.points_m[:-1], w.points_m[1:]], axis=1) for w in layout.wires]
    parts = np.reshape([part.position_m for part in layout.parts], (-1, 3))
    chosen = np.stack([plan.first, plan.second])
    lines = np.concatenate([regions, *wires])
    x, y = fit_axes(_AXES[view], _turn(np.concatenate([lines.reshape(-1, 3), parts]), view))
    nodes, shape = list_nodes(x, y)
    error = plan.map_error_deg(_into_plane(nodes, view, plan.first)).reshape(shape)
    levels = 2.0 ** np.arange(-5, 6)
    wanted = levels[levels > max(float(np.percentile(error, 5)), levels[0])][:5]
    layers, labels = draw_contours(error, wanted.tolist(), "°")
    layers += [
        draw_lines(locate(x, y, _turn(regions, view)), "allowed"),
        *(draw_lines(locate(x, y, _turn(one, view)), "lead") for one in wires),
        draw_dots(locate(x, y, _turn(parts, view)), "dots"),
        draw_dots(locate(x, y, _turn(chosen, view)), "dots chosen"),
    ]
    for part, at in zip(layout.parts, _turn(parts, view), strict=True):
        labels.append(label(part.name, locate(x, y, at), "part"))
    for name, at in zip("12", _turn(chosen, view), strict=True):
        labels.append(label(name, locate(x, y, at), "chosen"))
    title = "From above" if view == "above" else "From the right side"
    words = KEYS if view == "above" else KEYS | {"contour": "the same, in the plane of the first"}
    drawn = plot(x, y, layers, f"{title}: parts, regions and magnetometers", labels, "contours")
    return caption(title, drawn, words)


def _list_edges(region: Region) -> Array:
    """The edges (n, 2, 3) of a region, from end to end."""
    corners = np.array(list(product((0.0, 1.0), repeat=len(region.edges_m))))
    pairs = [(a, b) for a in corners for b in corners if (b >= a).all() and (b - a).sum() == 1]
    return np.asarray(region.corner_m + np.array(pairs) @ np.array(region.edges_m))


def _turn(at: Array, view: View) -> Array:
    """Places (…, 3) of the vehicle across and up a view."""
    x, y, z = np.moveaxis(at, -1, 0)
    return np.stack([y, x] if view == "above" else [x, -z], axis=-1)


def _into_plane(nodes: Array, view: View, through: Array) -> Array:
    """Places (n, 3) of points (n, 2) of a view, in the plane through one place."""
    across, up = nodes.T
    here = np.tile(through, (len(nodes), 1))
    columns = ((1, across), (0, up)) if view == "above" else ((0, across), (2, -up))
    for axis, values in columns:
        here[:, axis] = values
    return here
