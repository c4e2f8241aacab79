"""What a bias stands in for: axes of the ground calibration that were renamed, or one step of it.

A magnitude hardly tells an axis that was renamed or reversed since the ground: matrices are near to
the identity, and the bias of the flight takes up the rest. But nothing else leaves a bias near that
of the ground with other names of the axes, and far from it without. A step is otherwise followed by
a spline with many intervals.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.base import apply
from agonic.health import Finding, figure
from agonic.inflight.fit.solve import find_start, fit_rows
from agonic.inflight.maths.residuals import compute_residuals
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


MANY = 4
"""Intervals of the bias from which a step is looked for."""
STEP_WORSE = 1.05
"""Residuals with a step over those with the spline, up to which it explains them as well."""
BETTER = 0.97
"""And over those with a steady drift, from which on it is a step."""
PLACES = 40
STEP_ROWS = 4000
_LEAST = 10  # readings on either side


class Step(NamedTuple):
    """When the bias stepped, s, and by how much, nT; what is left over what the spline leaves, with
    the step and with a steady drift in its place."""

    time: float
    size: float
    left: float
    left_by_drift: float


def judge_step(fit: InflightFit, problem: Problem) -> Iterator[Finding]:
    """A step that explains the record as well as all the intervals do."""
    if fit.drift.intervals < MANY:
        return
    step = find_step(fit, problem)
    if step.left > min(STEP_WORSE, BETTER * step.left_by_drift):
        return
    yield Finding(
        "bias stepped",
        "check",
        f"the bias stepped by {figure(step.size)} nT near t = {step.time:.0f} s, which "
        f"explains the record as well as the {fit.drift.intervals} intervals of the bias do",
        "see what was switched, moved or exchanged then, and fit before and after it apart "
        "(--between)",
    )


def find_step(fit: InflightFit, problem: Problem) -> Step:
    """The step that explains the magnitude best, beside a bias that is constant otherwise.

    r ≈ J δ + J_bias s H(t − τ), for places τ over the record and then around the best of them.
    """
    plain = replace(problem, direction=None)
    constant = fit_rows(plain, find_start(plain), problem.used, 0)
    used = np.flatnonzero(problem.used & (fit.weights > 0))
    used = used[np.linspace(0, len(used) - 1, min(STEP_ROWS, len(used))).astype(int)]
    rows = plain.rows(constant.terms).select(used)
    r, jacobian = compute_residuals(rows, "magnitude", constant.solution.params, constant.layout)
    time = problem.time[used]
    low, high = float(time[0]), float(time[-1])
    best = (np.inf, low, 0.0)
    drift, _ = _fit_with((time - low) / (high - low), r, jacobian)
    for _ in range(2):
        width = (high - low) / (PLACES + 1)
        for at in low + width * np.arange(1.0, PLACES + 1):
            if _LEAST <= (time > at).sum() <= len(time) - _LEAST:
                left, size = _fit_with(time > at, r, jacobian)
                best = min(best, (left, float(at), size))
        low, high = best[1] - width, best[1] + width
    left, moment, size = best
    unit = problem.magnitude
    noise = max(fit.noise / unit, np.finfo(float).eps)
    return Step(moment, size * unit, left / noise, drift / noise)


def _fit_with(course: Array | Mask, r: Array, jacobian: Array) -> tuple[float, float]:
    """What a bias that follows a course in time (n,) leaves of residuals, and its size."""
    design = np.column_stack([jacobian, jacobian[:, :3] * course[:, None]])
    found = np.linalg.lstsq(design, r, rcond=None)[0]
    left = robust_scale(r - design @ found, design.shape[1])
    return left, float(np.linalg.norm(found[-3:]))
