"""Estimates by some of the readings of an estimate, from where that is.

What a part of a log says of bias and matrix is asked to judge the rest of the log by it. Its
minimum lies a few of its own standard errors from that of all readings.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Index
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import MAX_WRONG_SHARE, Estimate, solve_with_noise

_NEVER = 1e-9  # of its standard deviation: a term that changes by less in a part is still there


def estimate_part(problem: Problem, whole: Estimate, rows: Index) -> Estimate | None:
    """The estimate by rows (k,) of the problem that the `whole` is of, with its noise and weights.

    None where not nearly all of the rows agree with the whole, or they do not tell all of its
    unknowns.
    """
    weights = whole.weights[rows]
    if len(rows) < len(whole.solution.params) or np.mean(weights == 0.0) > MAX_WRONG_SHARE:
        return None
    part = problem.subset(rows[weights > 0.0])
    if part.terms is not None and (np.ptp(part.terms, axis=0) < _NEVER).any():
        return None
    try:
        solution = solve_with_noise(part, whole.noise, whole.solution.params)
    except np.linalg.LinAlgError:
        return None
    residuals = {channel: of[rows] for channel, of in whole.residuals.items()}
    return Estimate(solution, whole.noise, residuals, weights)
