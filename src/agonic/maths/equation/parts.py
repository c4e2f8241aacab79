"""Estimates by some of the readings of an estimate, from where that is.

What a part of a log says of bias and matrix is asked to judge the rest of the log by it. Noise,
correlation and losses are known from all readings, and the minimum lies a few of its own standard
errors from theirs: two or three Gauss–Newton steps lead there (of leaving rows out: R. D. Cook,
S. Weisberg, Residuals and Influence in Regression, 1982, takes the first of them only). Where the
part disagrees with all of that, this says so, and a fit of its own has to be made.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import FEW, Estimate, minimise, weigh

_NEVER = 1e-9  # of its standard deviation: a term that changes by less in a part is still there


def estimate_part(problem: Problem, whole: Estimate, rows: Index) -> Estimate | None:
    """The estimate by rows (k,) of the problem that the `whole` is of.

    None where nearly all of the rows do not agree with a minimum near that of the whole, or do not
    tell all of its unknowns.
    """
    counted = rows[whole.weights[rows] > 0]
    if len(counted) < len(whole.solution.params) or len(counted) < (1 - FEW) * len(rows):
        return None
    part = problem.subset(counted)
    if part.terms is not None and (np.ptp(part.terms, axis=0) < _NEVER).any():
        return None
    try:
        solution = minimise(part, whole.noise, whole.solution.params)
    except np.linalg.LinAlgError:  # so far off that numbers overflow
        return None
    left = np.split(solution.residuals, len(whole.noise))
    residuals = dict(zip(whole.noise, left, strict=True))
    weights = weigh(residuals, whole.noise)
    agrees = np.count_nonzero(weights) > (1 - FEW) * len(rows)
    if not (agrees and solution.converged and np.isfinite(solution.cost)):
        return None
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
