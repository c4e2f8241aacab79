"""A vehicle as a map: its parts, lines of equal heading error, and where magnetometers sit."""

from __future__ import annotations

from itertools import product
from typing import Literal

import numpy as np

from agonic.arrays import Array
from agonic.placement.layout import Region
from agonic.placement.plan import Placement
from agonic.report.contours import draw_map, fit_axes, list_nodes
from agonic.report.markup import Markup

View = Literal["above", "right"]
_AXES = {"above": ("y: right, m", "x: forward, m"), "right": ("x: forward, m", "z: up, m")}
_TURNS = {"above": ([1, 0], [1.0, 1.0]), "right": ([0, 2], [1.0, -1.0])}
"""Which axis of the vehicle goes across and which up, and their signs."""
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
    marks = [
        ("allowed", regions),
        *(("lead", wire) for wire in wires),
        ("dots", parts),
        ("dots chosen", chosen),
    ]
    names = [
        *((part.name, at, "part") for part, at in zip(layout.parts, parts, strict=True)),
        *((name, at, "chosen") for name, at in zip("12", chosen, strict=True)),
    ]
    shown = np.concatenate([*(one.reshape(-1, 3) for one in (regions, *wires)), parts])
    columns, signs = _TURNS[view]

    def turn(at: Array) -> Array:
        return np.asarray(at[..., columns] * signs)

    axes = fit_axes(_AXES[view], turn(shown))
    nodes, shape = list_nodes(*axes)
    here = np.tile(plan.first, (len(nodes), 1))
    here[:, columns] = nodes * signs
    error = plan.map_error_deg(here).reshape(shape)
    levels = 2.0 ** np.arange(-5, 6)
    title = "From above" if view == "above" else "From the right side"
    return draw_map(
        axes,
        error,
        levels[levels > max(float(np.percentile(error, 5)), levels[0])][:5],
        "°",
        title=title,
        keys=KEYS if view == "above" else KEYS | {"contour": "the same, in the plane of the first"},
        marks=[(name, turn(at)) for name, at in marks],
        names=[(text, turn(at), name) for text, at, name in names],
        said=f"{title}: parts, regions and magnetometers",
    )


def _list_edges(region: Region) -> Array:
    """The edges (n, 2, 3) of a region, from end to end."""
    corners = np.array(list(product((0.0, 1.0), repeat=len(region.edges_m))))
    pairs = [(a, b) for a in corners for b in corners if (b >= a).all() and (b - a).sum() == 1]
    return np.asarray(region.corner_m + np.array(pairs) @ np.array(region.edges_m))
