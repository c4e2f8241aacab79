"""The unknowns, the noise of each sensor, and the shots that do not fit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, fdtrc

from agonic.arrays import Array, Index, Mask
from agonic.errors import ConvergenceError
from agonic.inertial.maths.shots import SIGHT, linearise
from agonic.inertial.maths.variance_components import (
    Linear,
    Weighted,
    estimate_variances,
    weigh,
)
from agonic.inertial.pair.problem import EXPECTED_NOISE, Problem, hold_sight

RARE = 0.01
"""A shot is left out where chance would make one of them all so odd this often."""
MOST_LEFT_OUT = 0.25
CANDIDATES = 6
_ROUNDS, _FEW = 60, 4
_NEAR, _THERE = 0.1, 1e-4
"""Squares of a step, in standard errors: from where on the noise is worth its time, and the end."""


class Solution(NamedTuple):
    """Unknowns (q,), noise (3,) as sds, what the last round saw, and which shots (k,) counted."""

    unknowns: Array
    noise: Array
    linear: Linear
    weighted: Weighted
    kept: Index


def solve(problem: Problem) -> Solution:
    """The most probable unknowns, without the shots that the others contradict."""
    kept = np.arange(len(problem.shots.force))
    solution = _iterate(problem, kept, problem.start, EXPECTED_NOISE**2)
    while len(kept) > (1 - MOST_LEFT_OUT) * len(problem.shots.force):
        worst = find_outlier(solution)
        if worst is None:
            break
        kept = np.delete(kept, worst)
        solution = _iterate(problem, kept, solution.unknowns, solution.noise**2)
    return solution


def _iterate(problem: Problem, kept: Index, unknowns: Array, theta: Array) -> Solution:
    """Gauss–Newton, with the noise estimated anew at each step."""
    shots, prior, size = problem.shots.select(kept), problem.prior, 1.0
    for _ in range(_ROUNDS):
        pull = prior.information @ (unknowns - prior.mean)
        known = prior.information + hold_sight(unknowns)
        linear = Linear(*linearise(shots, unknowns), known, pull)
        few = {"rounds": _FEW} if size > _NEAR else {}
        theta = estimate_variances(linear, theta, EXPECTED_NOISE**2, **few)
        weighted = weigh(linear, theta)
        unknowns = unknowns + weighted.step * min(1.0, 0.5 / float(np.abs(weighted.step).max()))
        unknowns[SIGHT] /= np.linalg.norm(unknowns[SIGHT])
        size = float(weighted.step @ (weighted.information + linear.prior) @ weighted.step)
        if size < _THERE:
            return Solution(unknowns, np.sqrt(theta), linear, weighted, kept)
    raise ConvergenceError(
        "the two calibrations did not settle; are all shots of one instrument, at rest, in one "
        "place?"
    )


def find_outlier(solution: Solution) -> int | None:
    """The shot whose residuals the other shots make least probable, if chance hardly made them.

    Each of the likeliest is left out, the noise is estimated without it, and what it then shows is
    compared with what the others let one expect: an F of its residuals and their freedom.
    """
    theta, linear = solution.noise**2, solution.linear
    n = len(linear.residuals)
    odd = [_compare(solution.weighted, linear.there, i)[0] for i in range(n)]
    best: tuple[float, int] | None = None
    for i in np.argsort(odd)[:CANDIDATES]:
        others = linear.select(np.arange(n) != i)
        without = estimate_variances(others, theta, EXPECTED_NOISE**2)
        statistic, count = _predict(linear, others, without, int(i))
        freedom = max(weigh(others, without).freedom, 1.0)
        chance = float(fdtrc(count, freedom, statistic / count))
        if best is None or chance < best[0]:
            best = chance, int(i)
    return best[1] if best is not None and best[0] * n < RARE else None


def _compare(weighted: Weighted, there: Mask, i: int) -> tuple[float, float]:
    """The probability of a shot's residuals among the others, and their χ², noise as it is."""
    own = there[i]
    z, block = weighted.whitened[i][own], weighted.free[i][np.ix_(own, own)]
    square = float(z @ np.linalg.pinv(block, rcond=1e-9, hermitian=True) @ z)
    return float(chdtrc(int(own.sum()), square)), square


def _predict(linear: Linear, others: Linear, theta: Array, i: int) -> tuple[float, int]:
    """χ² of a shot's residuals at what the others tell, and how many they are."""
    own = linear.there[i]
    found = weigh(others, theta)
    jacobian = linear.jacobian[i][own]
    left = linear.residuals[i][own] + jacobian @ found.step
    variance = np.einsum("k,kij->ij", theta, linear.variances[:, i])[np.ix_(own, own)]
    spread = variance + jacobian @ found.covariance @ jacobian.T
    return float(left @ np.linalg.solve(spread, left)), int(own.sum())


def compare_shots(problem: Problem, solution: Solution) -> Array:
    """The residuals (n, 5) of all shots at the solution, in units of their standard deviations."""
    found = linearise(problem.shots, solution.unknowns)
    theta = solution.noise**2
    variance = np.einsum("k,knij->nij", theta, found.variances)
    spread = found.jacobian @ solution.weighted.covariance @ np.swapaxes(found.jacobian, 1, 2)
    out = ~np.isin(np.arange(len(found.residuals)), solution.kept)
    total = variance + np.where(out[:, None, None], spread, -spread)
    least, square = (np.diagonal(one, axis1=1, axis2=2) for one in (0.01 * variance, total))
    sd = np.where(found.there, np.sqrt(np.maximum(square, least)), 1.0)
    return np.where(found.there, found.residuals / sd, np.nan)
