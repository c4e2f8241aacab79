"""What is said and shown of places for magnetometers: of a mix, of a table, of a list of parts."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Literal

import numpy as np
from msgspec.structs import replace

from agonic.arrays import Array
from agonic.maths.rotations.deviation import HEEL, LEVEL
from agonic.placement.disturbance import disturb, draw_vehicles
from agonic.placement.layout import Region
from agonic.placement.mix import Mix
from agonic.placement.plan import Placement
from agonic.provenance import Input
from agonic.readable import make_record
from agonic.report.contours import draw_map, fit_axes, list_nodes
from agonic.report.digits import group_digits, quantity, significant, with_sd
from agonic.report.document import Document
from agonic.report.fields import make_table, write_field
from agonic.report.markup import Markup
from agonic.report.section import Section, Table, list_inputs

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


ALIKE = 0.3
"""Share of a disturbance that is the same at both places from which a mix costs much noise."""


def describe_placement(mix: Mix) -> Document:
    """Of a recording of two: what their mix leaves, what it costs, and where would be better."""
    factor = significant(mix.noise_factor, 2)
    alone, mixed = (
        f"{quantity(left, 'nT', 2)} of disturbance on an axis, noise {quantity(noise, 'nT', 2)}"
        for left, noise in ((mix.before, mix.noise_before), (mix.left, mix.noise))
    )
    same, opposite = mix.share > ALIKE, mix.share < -ALIKE
    way = "the same way" if same else "the opposite way" if opposite else "another way"
    return Document(
        schema="agonic/plan-placement@1",
        kind="Two magnetometers strapped down",
        name=f"{mix.first} and {mix.second}",
        status=f"{mix.second} sees {significant(abs(mix.share), 2)} of what disturbs {mix.first}, "
        f"{way}. Their mix leaves {quantity(mix.left, 'nT', 2)} of {quantity(mix.before, 'nT', 2)} "
        f"at {factor} times the noise. {_advise_place(mix)}",
        entries={
            "Alone": alone,
            "Mixed": f"{mixed}, {factor} times",
            "Heading": f"{write_field(mix, 'heading_deg')} of one reading in "
            f"{quantity(mix.horizontal, 'nT', 3)} of level field",
            "Mix": _write_mix(mix.matrix),
        },
        values={**make_record(mix), "matrix": mix.matrix},
    )


def _advise_place(mix: Mix) -> str:
    """Which placement would do better."""
    if mix.share > ALIKE and mix.left > 0.5 * mix.before:
        return (
            "They read nearly the same: move one to the other side of the source, or far from it."
        )
    if mix.share > ALIKE:
        return (
            "Where it saw the same with the other sign, the mix would have 0.71 times the noise: "
            "move it to the other side of what disturbs."
        )
    if abs(mix.share + 1.0) < ALIKE and mix.noise_factor < 0.85:
        return "No other place would do much better: opposite and equal is best."
    where = "to the other side of what disturbs, as far off as the first"
    if mix.share < -ALIKE:
        where = f"{'nearer to' if mix.share > -1 else 'farther from'} what disturbs"
    return f"Best would be opposite and equal, at 0.71 times the noise: move it {where}."


def describe_places(ranked: Sequence[Mix]) -> Document:
    """Of a table of places: pairs and single places, the best first."""
    best, alone = ranked[0], next(mix for mix in ranked if mix.second is None)
    said = (
        f"Best is {best.name}, which leaves {write_field(best, 'left')} of disturbance at "
        f"{significant(best.noise_factor, 2)} times the noise"
    )
    if best is not alone:
        said += f"; {alone.name} has {write_field(alone, 'left')}"
    return Document(
        schema="agonic/plan-placement@1",
        kind="Places for magnetometers",
        name="places",
        status=f"{said}.",
        sections=[Section("Places", [make_table(ranked)], printed=True)],
        values={"places": [make_record(mix) for mix in ranked]},
    )


def describe_plan(plan: Placement, source: Input | None = None) -> Document:
    """Of a list of parts: the best places, what to expect there, and a picture."""
    alone, _, _, mixed, mean = plan.compasses
    together = ", once each is calibrated" if plan.ensemble.calibrated else ""
    varied = any(np.ptp(drawn, axis=0).any() for drawn in plan.ensemble.vehicles[:-1])
    alike = "No part has a standard deviation: the errors here are those of mounting alone."
    return Document(
        schema="agonic/plan-placement@1",
        kind="Places for magnetometers",
        name=plan.layout.name,
        status=f"Put the two at {_name_place(plan.first)} and {_name_place(plan.second)}: their "
        f"mix has an error of {write_field(mixed, 'heading_deg')} of heading, rms in "
        f"service{together}. "
        f"The best place for one alone is {_name_place(plan.alone)}, with "
        f"{write_field(alone, 'heading_deg')}.",
        entries={
            "Mix": _write_mix(plan.mix),
            "Mean": f"half of each leaves {write_field(mean, 'heading_deg')} there",
            "Errors": "± is one standard deviation of a vehicle built after this list",
        },
        sections=[
            Section("The vehicle", [lambda: [draw_view(plan, "above"), draw_view(plan, "right")]]),
            Section("Heading error in service", [make_table(plan.compasses)], printed=True),
            _expect_deviation(plan),
            Section("What each adds", [_list_sources(plan)], printed=True),
            list_inputs(source, method=("hanson-hirshman-2002", "nga-2004")),
        ],
        styles=["contours.css"],
        remarks=() if varied else (alike,),
        values={**make_record(plan), "terms": [*LEVEL, *HEEL], "currents": [*plan.layout.currents]},
    )


def _name_place(at: Array) -> str:
    """A place in the axes of the vehicle."""
    x, y, z = (f"{v:.3f}" for v in np.round(at, 3) + 0.0)  # the sum turns −0 into 0
    return f"({x}, {y}, {z}) m"


def _write_mix(matrix: Array) -> str:
    rows = (" ".join(f"{v:.2f}" for v in row) for row in matrix)
    return "raw₁ − G (raw₂ − raw₁), G = " + "; ".join(rows)


def _expect_deviation(plan: Placement) -> Section:
    """A to E and heeling deviation; calibrated compasses have none."""
    if plan.ensemble.calibrated:
        return Section("", [])
    shown = plan.compasses[:-1]
    values = np.stack([one.coefficients for one in shown], axis=1)
    sds = np.stack([one.coefficients_sd for one in shown], axis=1)
    rows = []
    for k, term in enumerate([*LEVEL, *HEEL]):
        unit, digits = ("°", 2) if term in LEVEL else ("°/°", 4)
        pairs = zip(values[k].tolist(), sds[k].tolist(), strict=True)
        cells = (f"{group_digits(v, digits)} ± {group_digits(sd, digits)}" for v, sd in pairs)
        rows.append([f"{term.replace('_', ' ')}, {unit}", *cells])
    table = Table(("Deviation", *(one.name for one in shown)), rows, scrolls=True)
    return Section("Deviation to expect", [table], printed=True)


def _list_sources(plan: Placement) -> Table:
    """What each current adds from least to most, and each part as it is, at the places."""
    layout, shown = plan.layout, plan.compasses[1:4]
    rows = []
    for k, (name, (low, high)) in enumerate(layout.currents.items()):
        pairs = ((float(one.interference[k]), float(one.interference_sd[k])) for one in shown)
        cells = (f"{with_sd(*pair)} nT" for pair in pairs)
        rows.append([f"{name}, {low:g} to {high:g} A", *cells])
    for part in () if plan.ensemble.calibrated else layout.parts:
        one = replace(layout, parts=[part], wires=[])
        own = draw_vehicles(one, 0, np.random.default_rng(0))
        made = disturb(one, own, np.stack([plan.first, plan.second]))
        a, b = made.hard[0] + made.soft[0] @ one.field_n  # as it heads north, level
        sizes = (float(np.linalg.norm(v)) for v in (a, b, a - plan.mix @ (b - a)))
        rows.append([part.name, *(quantity(size, "nT") for size in sizes)])
    return Table(("Source", "At the first", "At the second", "In the mix"), rows)
