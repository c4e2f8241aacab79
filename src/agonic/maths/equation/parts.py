"""Estimates by some of the readings of an estimate, from where that is.

What a part of a log says of bias and matrix is asked to judge the rest of the log by it. Its
minimum lies a few of its own standard errors from that of all readings, and what its residuals do
to its standard errors is what all residuals did.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import Estimate, find_near, solve_with_noise

_NEVER = 1e-9  # of its standard deviation: a term that changes by less in a part is still there


def estimate_part(
    problem: Problem,
    whole: Estimate,
    rows: Index,
    *,
    robust: bool = True,
    noise_known: bool = False,
) -> Estimate | None:
    """The estimate by rows (k,) of the problem that the `whole` is of.

    None where not nearly all of the rows agree with a minimum near that of the whole, or they do
    not tell all of its unknowns. With `noise_known` noise, residuals and weights are those of the
    whole, and only the parameters are sought.
    """
    if len(rows) < len(whole.solution.params):
        return None
    part = problem.subset(rows)
    if part.terms is not None and (np.ptp(part.terms, axis=0) < _NEVER).any():
        return None
    if not noise_known:
        return find_near(part, whole.solution.params, robust)
    weights = whole.weights[rows]
    counted = part if weights.all() else part.subset(np.flatnonzero(weights))
    try:
        solution = solve_with_noise(counted, whole.noise, whole.solution.params)
    except np.linalg.LinAlgError:
        return None
    residuals = {channel: of[rows] for channel, of in whole.residuals.items()}
    return Estimate(solution, whole.noise, residuals, weights)


def restate(
    part: Estimate, found: Estimate, stated: Estimate, shared: Array | float = 0.0
) -> Estimate:
    """The estimate by a part with what became of that by all readings after it was `found`.

    What corrected the latter moves the former as far, θ + (θ_stated − θ_found); its covariance
    R C Rᵀ + `shared` is as much wider, C_stated = R C_found Rᵀ, and errors that all rows share add
    to either the same. As it is where a covariance is none.
    """
    was, now, own = found.solution, stated.solution, part.solution
    size = np.sqrt(np.diag(was.covariance))
    by = np.outer(size, size)
    try:
        before, after = (np.linalg.cholesky(of.covariance / by) for of in (was, now))
    except np.linalg.LinAlgError:
        before = after = np.eye(len(size))
    root = after @ np.linalg.inv(before)
    covariance = root @ (own.covariance / by) @ root.T * by + shared
    moved = own.params + (now.params - was.params)
    return part._replace(solution=own._replace(params=moved, covariance=covariance))
