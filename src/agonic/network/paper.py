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
from agonic.report.markup import Markup
from agonic.report.section import Section, Table
from agonic.report.strips import caption

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

    @property
    def late(self) -> Mask:
        """The rows after the change."""
        assert self.made.samples.time is not None
        return np.asarray(self.made.samples.time >= CHANGE_S)

    def errors(self, fit: NetworkFit, rows: Mask) -> tuple[Array, Array]:
        """Times (k,), s, of some rows, and the largest component of the error (k,) of each, nT."""
        part = self.made.select(rows)
        assert part.samples.time is not None
        field, _ = fit.calibration.evaluated(part.samples.field, {})
        return part.samples.time, np.asarray(np.abs(field - part.field).max(axis=1))


def reproduce_paper(*, noise: float = 2.0, seed: int = 0) -> Reproduction:
    """The simulation of Wang et al. (2020): three nodes, no base, nothing that restrains weights.

    Parameters: `noise` standard deviation of a reading on an axis, nT; `seed` of noise and starts.

    Source: Wang, Sheng, He & Cheng (2020), doi:10.4236/jcc.2020.86004.
    """
    made = simulate_paper(DURATION_S, noise=noise, seed=seed)
    assert made.samples.time is not None
    late = np.asarray(made.samples.time >= CHANGE_S)
    ground, orbit = made.select(~late), made.select(late)
    space = simulate_paper(CHANGE_S, directions="space", noise=noise, seed=seed)
    fit = fit_network(
        ground.samples,
        ground.reference,
        base=None,
        stopping="plain",
        restarts=1,
        compared=False,
        seed=seed,
    )
    again = fit_network(
        orbit.samples,
        orbit.reference,
        stopping="plain",
        start=fit.calibration,
        compared=False,
    )
    return Reproduction(
        made=made,
        ground=fit,
        again=again,
        methods=compare_methods(ground.samples, ground.reference, base=None, seed=seed),
        plane=_choose(ground, seed),
        space=_choose(space, seed),
    )


def _choose(made: SimulatedField, seed: int) -> NetworkChoice:
    return choose_network(
        made.samples, made.reference, hidden=NODES, base=None, stopping="plain", seed=seed
    )


PUBLISHED: dict[Nodes, float] = {7: 0.9999, 6: 0.9999, 5: 0.9999, 4: 0.9999, 3: 0.9999, 2: 0.82121}
"""The regression coefficient by hidden nodes, table 1 of the paper."""
LIMIT, CHANGED = 10.0, 30.0
"""Largest errors that the paper names, nT: trained, and after the change."""


def describe_paper(found: Reproduction) -> Document:
    """The reproduction of the paper as page, text and JSON."""
    early = found.made.select(~found.late)
    fields = evaluate_fit(found.ground, early.samples)
    values = _measure(found) | {"regression_of_axes": correlate_axes(*fields)}
    return Document(
        schema="agonic/simulate-network@1",
        kind="Simulation of Wang et al. (2020)",
        name="network",
        title="A network calibrates a magnetometer",
        about="As published in J. Comput. Commun. 8, 31–41, doi:10.4236/jcc.2020.86004.",
        sections=[
            Section("Beside the paper", [_compare(values)], printed=True),
            Section("Mean square error", compare(found.ground, found.methods, *_TRAINED)),
            Section("Regression", [lambda: draw_axes(*fields)], style="pair"),
            Section("Calibrated on the ground", [lambda: _draw_ground(found)]),
            Section("After the change, and retrained", [lambda: _draw_change(found)]),
            Section("Hidden nodes", [_list_nodes(found), PLANE], printed=True),
        ],
        values=values,
        calibration=None,
        samples=None,
        styles=("network.css",),
    )


_TRAINED = ("Error after each epoch", "From the same random start.")
PLANE = (
    "The printed field never leaves a plane, for which two nodes are enough; the table that was "
    "published comes out where directions fill space, of which two nodes span a plane: R = √(2/3)."
)


def _measure(found: Reproduction) -> dict[str, Any]:
    marquardt, descent, adaptive = found.methods
    return {
        "kind": "network",
        "n": len(found.made.field),
        "epochs": marquardt.epochs_to_goal,
        "epochs_of_descent": descent.epochs_to_goal,
        "epochs_of_adaptive_descent": adaptive.epochs_to_goal,
        "ground_max_nT": float(found.errors(found.ground, ~found.late)[1].max()),
        "changed_max_nT": float(found.errors(found.ground, found.late)[1].max()),
        "retrained_max_nT": float(found.errors(found.again, found.late)[1].max()),
        "regression": found.ground.regression,
        "regression_in_space": {row.hidden: row.regression for row in found.space.table},
        "regression_in_the_plane": {row.hidden: row.regression for row in found.plane.table},
        "methods": [make_record(method) for method in found.methods],
    }


def _compare(values: dict[str, Any]) -> Table:
    epochs, descent = (values[name] or "never" for name in ("epochs", "epochs_of_descent"))
    rows = [
        ["epochs to a mean square error of 0.001", "26", f"{epochs}"],
        ["the same by gradient descent", "–", f"{descent}"],
        ["largest error on the ground", "< 10 nT", quantity(values["ground_max_nT"], "nT")],
        ["largest error after the change", "30 nT", quantity(values["changed_max_nT"], "nT")],
        ["largest error, retrained", "< 10 nT", quantity(values["retrained_max_nT"], "nT")],
    ]
    return Table(["", "published", "here"], rows, "nodes")


def _list_nodes(found: Reproduction) -> Table:
    rows = []
    for space, plane in zip(found.space.table, found.plane.table, strict=True):
        of = (PUBLISHED[space.hidden], space.regression, plane.regression)
        rows.append([str(space.hidden), *(f"{r:.5f}" for r in of)])
    head = ["Nodes", "R published", "directions in space", "the printed plane"]
    return Table(head, rows, "nodes")


def _draw_ground(found: Reproduction) -> Markup:
    drawn = figures.draw_errors({"training": found.errors(found.ground, ~found.late)}, [LIMIT])
    keys = {"training": "trained on the ground", "limit": "10 nT"}
    return caption("Largest component of the error", drawn, keys)


def _draw_change(found: Reproduction) -> Markup:
    curves = {
        "held": found.errors(found.ground, found.late),
        "training": found.errors(found.again, found.late),
    }
    drawn = figures.draw_errors(curves, [LIMIT, CHANGED])
    keys = {
        "held": "trained on the ground",
        "training": "trained again in orbit",
        "limit": "10 and 30 nT",
    }
    return caption("Largest component of the error, from 15 s on", drawn, keys)
