"""`reproduce_paper`: a network calibrates a magnetometer on the ground, and once more in orbit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array, Mask
from agonic.network.fit import (
    Method,
    NetworkChoice,
    NetworkFit,
    choose_network,
    compare_methods,
    fit_network,
)
from agonic.network.fit.selection import NODES
from agonic.network.simulate import CHANGE_S, SimulatedField, simulate_paper

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

    @property
    def early(self) -> Mask:
        """The rows before it."""
        return ~self.late

    def errors(self, fit: NetworkFit, rows: Mask) -> tuple[Array, Array]:
        """Times (k,), s, of some rows, and the largest component of the error (k,) of each, nT."""
        part = self.made.select(rows)
        assert part.samples.time is not None
        field, _ = fit.calibration.evaluated(part.samples.field, {})
        return part.samples.time, np.asarray(np.abs(field - part.field).max(axis=1))

    def largest(self, fit: NetworkFit, rows: Mask) -> float:
        """The largest error of a component among some rows, nT."""
        return float(self.errors(fit, rows)[1].max())


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
