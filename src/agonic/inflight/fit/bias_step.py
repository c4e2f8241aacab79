"""One step of the bias, which otherwise a spline follows with many intervals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.health import Finding, figure
from agonic.inflight.fit.solve import find_start, fit_rows
from agonic.inflight.maths.residuals import compute_residuals
from agonic.maths.estimation.noise.residuals import robust_scale

if TYPE_CHECKING:
    from agonic.inflight.fit.problem import Problem
    from agonic.inflight.fit.result import InflightFit

MANY = 4
"""Intervals of the bias from which a step is looked for."""
WORSE = 1.05
"""Residuals with a step over those with the spline, up to which it explains them as well."""
BETTER = 0.97
"""And over those with a steady drift, from which on it is a step."""
PLACES = 40
SOME = 4000
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
    if step.left > min(WORSE, BETTER * step.left_by_drift):
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
    used = used[np.linspace(0, len(used) - 1, min(SOME, len(used))).astype(int)]
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
