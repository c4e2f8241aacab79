"""The simulation of Wang et al. (2020) from end to end, and its numbers beside the paper's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from agonic.arrays import Array, Mask
from agonic.maths.equation.network import Nodes
from agonic.network.fit import (
    Method,
    NetworkChoice,
    NetworkFit,
    choose_network,
    compare_methods,
    fit_network,
)
from agonic.network.fit.selection import NODES
from agonic.network.report import figures
from agonic.network.report.document import compare, correlate_axes, draw_axes, evaluate_fit
from agonic.network.simulate import CHANGE_S, SimulatedField, simulate_paper
from agonic.readable import make_record
from agonic.report.digits import quantity
from agonic.report.document import Document
from agonic.report.figure import Figure
from agonic.report.marks import level
from agonic.report.section import Section, Table

DURATION_S = 30.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Reproduction:
    """What came of the simulation of the paper.

    `made` readings and field of 30 s, whose sensor changes at 15 s; `ground` the network of the
    first half, as the paper trains it, and `again` of the second, from the weights of the first;
    `methods` Levenberg–Marquardt and gradient descent on the first half; `plane` and `space` the
    table of hidden nodes in the printed field, and in one whose directions fill space.
    """

    made: SimulatedField
    ground: NetworkFit
    again: NetworkFit
    methods: tuple[Method, ...]
    plane: NetworkChoice
    space: NetworkChoice

    def errors(self, fit: NetworkFit, *, late: bool) -> tuple[Array, Array]:
        """Times (k,), s, of either half, and the largest component of the error (k,) of each."""
        part = self.made.select(_is_late(self.made) == late)
        assert part.samples.time is not None
        field, _ = fit.calibration.evaluated(part.samples.field, {})
        return part.samples.time, np.asarray(np.abs(field - part.field).max(axis=1))


def _is_late(made: SimulatedField) -> Mask:
    """The rows after the change."""
    assert made.samples.time is not None
    return np.asarray(made.samples.time >= CHANGE_S)


def reproduce_paper(*, noise: float = 2.0, seed: int = 0) -> Reproduction:
    """The simulation of Wang et al. (2020): three nodes, no base, nothing that restrains weights.

    Parameters: `noise` standard deviation of a reading on an axis, nT; `seed` of noise and starts.

    Source: Wang, Sheng, He & Cheng (2020), doi:10.4236/jcc.2020.86004.
    """
    made = simulate_paper(DURATION_S, noise=noise, seed=seed)
    ground, orbit = made.select(~_is_late(made)), made.select(_is_late(made))
    space = simulate_paper(CHANGE_S, directions="space", noise=noise, seed=seed)
    plain: dict[str, Any] = {"base": None, "stopping": "plain", "seed": seed}
    known = ground.samples, ground.reference
    fit = fit_network(*known, restarts=1, compared=False, **plain)
    again = fit_network(
        orbit.samples, orbit.reference, stopping="plain", start=fit.calibration, compared=False
    )
    return Reproduction(
        made=made,
        ground=fit,
        again=again,
        methods=compare_methods(*known, base=None, seed=seed),
        plane=choose_network(*known, hidden=NODES, **plain),
        space=choose_network(space.samples, space.reference, hidden=NODES, **plain),
    )


PUBLISHED: dict[Nodes, float] = {7: 0.9999, 6: 0.9999, 5: 0.9999, 4: 0.9999, 3: 0.9999, 2: 0.82121}
"""The regression coefficient by hidden nodes, table 1 of the paper."""
LIMIT, CHANGED = 10.0, 30.0
"""Largest errors that the paper names, nT: trained, and after the change."""


PLANE = (
    "The printed field never leaves a plane, for which two nodes are enough; the table that was "
    "published comes out where directions fill space, of which two nodes span a plane: R = √(2/3)."
)


def describe_paper(found: Reproduction) -> Document:
    """The reproduction of the paper as page, text and JSON."""
    fields = evaluate_fit(found.ground, found.made.select(~_is_late(found.made)).samples)
    values = _measure(found) | {"regression_of_axes": correlate_axes(*fields)}
    trained = ("Error after each epoch", "From the same random start.")
    return Document(
        schema="agonic/simulate-network@1",
        kind="Simulation of Wang et al. (2020)",
        name="network",
        title="A network calibrates a magnetometer",
        about="As published in J. Comput. Commun. 8, 31–41, doi:10.4236/jcc.2020.86004.",
        sections=[
            Section("Beside the paper", [_compare(values)], printed=True),
            Section("Mean square error", compare(found.ground, found.methods, *trained)),
            Section("Regression", [lambda: draw_axes(*fields)], style="pair"),
            Section("Calibrated on the ground", [lambda: _draw(found, [LIMIT])]),
            Section("After the change, and retrained", [lambda: _draw(found, [LIMIT, CHANGED])]),
            Section("Hidden nodes", [_list_nodes(found), PLANE], printed=True),
        ],
        values=values,
        calibration=None,
        samples=None,
        styles=("network.css",),
    )


def _measure(found: Reproduction) -> dict[str, Any]:
    marquardt, descent, adaptive = found.methods
    return {
        "kind": "network",
        "n": len(found.made.field),
        "epochs": marquardt.epochs_to_goal,
        "epochs_of_descent": descent.epochs_to_goal,
        "epochs_of_adaptive_descent": adaptive.epochs_to_goal,
        "ground_max_nT": float(found.errors(found.ground, late=False)[1].max()),
        "changed_max_nT": float(found.errors(found.ground, late=True)[1].max()),
        "retrained_max_nT": float(found.errors(found.again, late=True)[1].max()),
        "regression": found.ground.regression,
        "regression_in_space": {row.hidden: row.regression for row in found.space.table},
        "regression_in_the_plane": {row.hidden: row.regression for row in found.plane.table},
        "methods": [make_record(method) for method in found.methods],
    }


def _compare(values: dict[str, Any]) -> Table:
    rows = [
        ("epochs to a mean square error of 0.001", "26", "epochs"),
        ("the same by gradient descent", "–", "epochs_of_descent"),
        ("largest error on the ground", "< 10 nT", "ground_max_nT"),
        ("largest error after the change", "30 nT", "changed_max_nT"),
        ("largest error, retrained", "< 10 nT", "retrained_max_nT"),
    ]
    here = {
        name: quantity(values[name], "nT") if name.endswith("nT") else f"{values[name] or 'never'}"
        for *_, name in rows
    }
    made = [[what, published, here[name]] for what, published, name in rows]
    return Table(["", "published", "here"], made, "nodes")


def _list_nodes(found: Reproduction) -> Table:
    rows = [
        [str(space.hidden)]
        + [f"{r:.5f}" for r in (PUBLISHED[space.hidden], space.regression, plane.regression)]
        for space, plane in zip(found.space.table, found.plane.table, strict=True)
    ]
    head = ["Nodes", "R published", "directions in space", "the printed plane"]
    return Table(head, rows, "nodes")


def _draw(found: Reproduction, levels: list[float]) -> Figure:
    """The errors before the change, or after it where its level is drawn too."""
    if CHANGED not in levels:
        curves = {("training", "trained on the ground"): found.errors(found.ground, late=False)}
        title, words = "Largest component of the error", "10 nT"
    else:
        curves = {
            ("held", "trained on the ground"): found.errors(found.ground, late=True),
            ("training", "trained again in orbit"): found.errors(found.again, late=True),
        }
        title, words = "Largest component of the error, from 15 s on", "10 and 30 nT"
    return figures.draw_errors(title, level("limit", levels, words=words), curves)
