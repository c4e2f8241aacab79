"""Estimates by some of the readings of an estimate, from where that is.

What a part of a log says of bias and matrix is asked to judge the rest of the log by it. Its
minimum lies a few of its own standard errors from that of all readings.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Index
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
