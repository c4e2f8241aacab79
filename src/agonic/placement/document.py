"""What is said and shown of places for magnetometers: of a mix, of a table, of a list of parts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np

from agonic.arrays import Array
from agonic.maths.rotations.deviation import HEEL, LEVEL
from agonic.placement.disturbance import disturb, draw_vehicles
from agonic.placement.figures import draw_view
from agonic.placement.mix import Mix
from agonic.placement.plan import Placement
from agonic.provenance import Input
from agonic.readable import make_record
from agonic.report.digits import group_digits, quantity, significant, with_sd
from agonic.report.document import Document
from agonic.report.fields import make_table
from agonic.report.section import Section, Table, list_inputs

ALIKE = 0.3
"""Share of a disturbance that is the same at both places from which a mix costs much noise."""
PLACES = ("Magnetometers", "Disturbance left", "Noise", "Heading, one reading")


def describe_placement(mix: Mix, horizontal: float) -> Document:
    """Of a recording of two: what their mix leaves, what it costs, and where would be better."""
    return Document(
        schema="agonic/plan-placement@1",
        kind="Two magnetometers strapped down",
        name=f"{mix.first} and {mix.second}",
        status=f"{_judge_mix(mix)} {_advise_place(mix)}",
        entries={
            "Alone": f"{quantity(mix.before, 'nT', 2)} of disturbance on an axis, noise "
            f"{quantity(mix.noise_before, 'nT', 2)}",
            "Mixed": f"{quantity(mix.left, 'nT', 2)} of disturbance on an axis, noise "
            f"{quantity(mix.noise, 'nT', 2)}, {significant(mix.noise_factor, 2)} times",
            "Heading": f"{significant(mix.heading_deg(horizontal), 2)}° of one reading in "
            f"{quantity(horizontal, 'nT', 3)} of level field",
            "Mix": "raw₁ − G (raw₂ − raw₁), G = "
            + "; ".join(" ".join(f"{v:.2f}" for v in row) for row in mix.matrix),
        },
        values={**_values(mix, horizontal), "matrix": mix.matrix},
    )


def describe_places(ranked: Sequence[Mix], horizontal: float) -> Document:
    """Of a table of places: pairs and single places, the best first."""
    best = ranked[0]
    alone = next(mix for mix in ranked if not mix.second)
    rows = [
        [
            _name(mix),
            quantity(mix.left, "nT", 2),
            f"{significant(mix.noise_factor, 2)} ×",
            f"{significant(mix.heading_deg(horizontal), 2)}°",
        ]
        for mix in ranked
    ]
    said = (
        f"Best is {_name(best)}, which leaves {quantity(best.left, 'nT', 2)} of disturbance at "
        f"{significant(best.noise_factor, 2)} times the noise"
    )
    if best is not alone:
        said += f"; {alone.first} alone has {quantity(alone.left, 'nT', 2)}"
    return Document(
        schema="agonic/plan-placement@1",
        kind="Places for magnetometers",
        name="places",
        status=f"{said}.",
        sections=[Section("Places", [Table(PLACES, rows, style="numbers")], printed=True)],
        values={"places": [_values(mix, horizontal) for mix in ranked]},
    )


def _name(mix: Mix) -> str:
    return f"{mix.first} with {mix.second}" if mix.second else f"{mix.first} alone"


def _judge_mix(mix: Mix) -> str:
    """What the two see, and what their mix leaves."""
    way = (
        "the same way"
        if mix.share > ALIKE
        else "the opposite way"
        if mix.share < -ALIKE
        else "another way"
    )
    return (
        f"{mix.second} sees {significant(abs(mix.share), 2)} of what disturbs {mix.first}, {way}. "
        f"Their mix leaves {quantity(mix.left, 'nT', 2)} of {quantity(mix.before, 'nT', 2)} at "
        f"{significant(mix.noise_factor, 2)} times the noise."
    )


def _advise_place(mix: Mix) -> str:
    """Which placement would do better."""
    if mix.left > 0.5 * mix.before and mix.share > ALIKE:
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
    if mix.share < -ALIKE:
        nearer = "nearer to" if mix.share > -1 else "farther from"
        return (
            f"Best would be opposite and equal, at 0.71 times the noise: move it {nearer} what "
            "disturbs."
        )
    return (
        "Best would be opposite and equal, at 0.71 times the noise: move it to the other side of "
        "what disturbs, as far off as the first."
    )


def _values(mix: Mix, horizontal: float) -> dict[str, Any]:
    more = {"second": mix.second or None, "heading_deg": mix.heading_deg(horizontal)}
    return make_record(mix) | more


def describe_plan(plan: Placement, source: Input | None = None) -> Document:
    """Of a list of parts: the best places, what to expect there, and a picture."""
    layout = plan.layout
    alone, _, _, mixed, mean = plan.compasses
    said = (
        f"Put the two at {_name_place(plan.first)} and {_name_place(plan.second)}: their mix errs "
        f"by {with_sd(mixed.heading_deg, mixed.heading_sd_deg)}° of heading, rms in service"
    )
    if plan.ensemble.calibrated:
        said += ", once each is calibrated"
    said += (
        f". The best place for one alone is {_name_place(plan.alone)}, with "
        f"{with_sd(alone.heading_deg, alone.heading_sd_deg)}°."
    )
    entries = {
        "Mix": "raw₁ − G (raw₂ − raw₁), G = " + _write_matrix(plan.mix),
        "Mean": f"half of each leaves {with_sd(mean.heading_deg, mean.heading_sd_deg)}° there",
        "Errors": "± is one standard deviation of a vehicle built after this list",
    }
    return Document(
        schema="agonic/plan-placement@1",
        kind="Places for magnetometers",
        name=layout.name,
        status=said,
        entries=entries,
        sections=[
            Section("The vehicle", [lambda: [draw_view(plan, "above"), draw_view(plan, "right")]]),
            Section("Heading error in service", [make_table(plan.compasses)], printed=True),
            *_expect_deviation(plan),
            Section("What each adds", [_list_sources(plan)], printed=True),
            list_inputs(source, method=("hanson-hirshman-2002", "nga-2004")),
        ],
        styles=["contours.css"],
        remarks=_remark(plan),
        values={**make_record(plan), "terms": [*LEVEL, *HEEL], "currents": [*layout.currents]},
    )


def _name_place(at: Array) -> str:
    """A place in the axes of the vehicle."""
    x, y, z = (f"{v + 0.0:.3f}" for v in np.round(at, 3) + 0.0)
    return f"({x}, {y}, {z}) m"


def _write_matrix(matrix: Array) -> str:
    return "; ".join(" ".join(f"{v:.2f}" for v in row) for row in matrix)


def _expect_deviation(plan: Placement) -> list[Section]:
    """A to E and heeling deviation; calibrated compasses have none."""
    if plan.ensemble.calibrated:
        return []
    names = [*(f"{one}, °" for one in LEVEL), *(f"{one.replace('_', ' ')}, °/°" for one in HEEL)]
    shown = plan.compasses[:-1]
    rows = [
        [
            name,
            *(
                f"{group_digits(float(one.coefficients[k]), digits)} ± "
                f"{group_digits(float(one.coefficients_sd[k]), digits)}"
                for one in shown
            ),
        ]
        for k, name in enumerate(names)
        for digits in (2 if k < len(LEVEL) else 4,)
    ]
    table = Table(("Deviation", *(one.name for one in shown)), rows, scrolls=True)
    return [Section("Deviation to expect", [table], printed=True)]


def _list_sources(plan: Placement) -> Table:
    """What each current adds from least to most, and each part as it is, at the places."""
    _, first, second, mixed, _ = plan.compasses
    rows = [
        [
            f"{name}, {low:g} to {high:g} A",
            *(
                f"{with_sd(float(one.interference[k]), float(one.interference_sd[k]))} nT"
                for one in (first, second, mixed)
            ),
        ]
        for k, (name, (low, high)) in enumerate(plan.layout.currents.items())
    ]
    at = np.stack([plan.first, plan.second])
    for part in () if plan.ensemble.calibrated else plan.layout.parts:
        one = msgspec.structs.replace(plan.layout, parts=[part], wires=[])
        made = disturb(one, draw_vehicles(one, 0, np.random.default_rng(0)), at)
        a, b = made.hard[0] + made.soft[0] @ one.field_n  # as it heads north, level
        sizes = (float(np.linalg.norm(v)) for v in (a, b, a - plan.mix @ (b - a)))
        rows.append([part.name, *(quantity(size, "nT") for size in sizes)])
    return Table(("Source", "At the first", "At the second", "In the mix"), rows)


def _remark(plan: Placement) -> list[str]:
    """What the numbers do not hold."""
    parts, wires = plan.layout.parts, plan.layout.wires
    sds = [part.position_sd_m + part.moment_sd_A_m2 + part.induced_sd_m3 for part in parts]
    if any([*sds, *(wire.position_sd_m for wire in wires)]):
        return []
    return ["No part has a standard deviation: the errors here are those of mounting alone."]
