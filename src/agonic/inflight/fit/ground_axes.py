"""Whether the ground calibration is of this sensor in these axes: by the bias that it leaves.

A magnitude hardly tells an axis that was renamed or reversed since the ground: matrices are near to
the identity, and the bias of the flight takes up the rest. But nothing else leaves a bias near that
of the ground with other names of the axes, and far from it without.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from agonic.arrays import Array
from agonic.calibration.base import apply
from agonic.health import Finding, figure
from agonic.maths.estimation.noise.residuals import robust_scale
from agonic.maths.rotations.mounting import describe_renaming, right_angles
from agonic.samples import Samples

if TYPE_CHECKING:
    from agonic.inflight.fit.problem import Problem
    from agonic.inflight.fit.result import InflightFit

FAR = 0.1
"""Move of the bias over the field from which other names of the axes are tried."""
DOUBTFUL = 0.25
"""Move of the bias over the field that hardware hardly makes."""
NEARER = 1 / 3
"""Other names must leave so much of the move, or less."""
WORSE = 1.1
"""Residuals with other names over those of the best, up to which they do as well."""
SOME = 1000


def judge_ground_axes(fit: InflightFit, problem: Problem, samples: Samples) -> Iterator[Finding]:
    """A bias so far from the ground's that the axes, or the sensor, are others."""
    if problem.ground is None:
        return
    moved = float(np.linalg.norm(fit.change.bias))
    if moved < FAR * problem.magnitude:
        return
    what = f"the bias is {figure(moved)} nT from that of the ground"
    names, left, plain = _find_nearest(problem, samples)
    if names and left < min(NEARER * min(moved, plain), FAR * problem.magnitude):
        yield Finding(
            "axes of the ground calibration",
            "refuse",
            f"{what}, and {figure(left)} nT if since then {names}",
            "give the readings in the axes in which the sensor was calibrated",
        )
        return
    if not is_far(fit, problem):
        return
    yield Finding(
        "axes of the ground calibration",
        "check",
        f"{what}, {figure(100 * moved / problem.magnitude)} % of the field",
        "check that the calibration is of this sensor, in these axes and this unit",
    )


def is_far(fit: InflightFit, problem: Problem) -> bool:
    """Whether the bias moved since the ground by more than hardware hardly makes."""
    return bool(np.linalg.norm(fit.change.bias) >= DOUBTFUL * problem.magnitude)


def _find_nearest(problem: Problem, samples: Samples) -> tuple[str, float, float]:
    """What is wrong with the names of the axes where others leave the bias nearest to the ground's,
    among all with which the magnitude is as constant, no words where nothing is; how far it is
    then, nT; and how far with the names that they have."""
    assert problem.ground is not None
    rows = np.flatnonzero(problem.used)
    rows = rows[np.linspace(0, len(rows) - 1, min(SOME, len(rows))).astype(int)]
    some, wanted = samples.select(rows), problem.wanted[rows]
    tried = []
    for turn in np.concatenate([right_angles(), -right_angles()]):
        field = apply(problem.ground, some.with_columns(field=some.field @ turn.T)).field
        bias, left = _fit_bias(field / problem.magnitude, wanted)
        tried.append((float(np.linalg.norm(bias)) * problem.magnitude, left, turn))
    limit = WORSE * min(left for _, left, _ in tried)
    moved, _, turn = min((one for one in tried if one[1] <= limit), key=lambda one: one[0])
    words = "" if np.array_equal(turn, np.eye(3)) else describe_renaming(turn)
    return words, moved, tried[0][0]


def _fit_bias(field: Array, wanted: Array) -> tuple[Array, float]:
    """The bias (3,) of |field − bias| = wanted, and the scale of what is left.

    |u|² − F² = 2 u·b − |b|²
    """
    design = np.column_stack([2.0 * field, np.ones(len(field))])
    known = np.einsum("ni,ni->n", field, field) - wanted**2
    solution = np.linalg.lstsq(design, known, rcond=None)[0]
    return solution[:3], robust_scale(known - design @ solution, 4)
