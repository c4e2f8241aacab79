"""What a drift that unseen readings do not ask for may still be, in the standard error.

A drift of a few standard errors of the bias makes no block of unseen readings fit surely better, so
the bias counts as constant, and is off at the end by several of its standard errors. That it drifts
is one model and that it does not another: both are averaged.
"""

from __future__ import annotations

import numpy as np

from agonic.inflight.fit.calibration import build_drift
from agonic.inflight.fit.drift import evaluate_spline
from agonic.inflight.fit.problem import Problem
from agonic.inflight.fit.solve import Estimate, find_start, fit_rows, state_errors
from agonic.maths.estimation.inference.model_averaging import average_over_term

DRIFTING = 0.1
"""Probability of a drift before the readings are seen, where unseen blocks do not ask for one."""


def allow_for_unseen_drift(problem: Problem, estimate: Estimate) -> Estimate:
    """The estimate of a bias that was chosen to be constant, grown by the drift that it may have.

    The calibration is that at the end of the record, and so is what the drift adds to it. Nothing
    changes where a drift was found, or the number of intervals was given.
    """
    if estimate.terms.splines or 1 not in estimate.held_out:
        return estimate
    fitted = fit_rows(problem, find_start(problem), problem.used, 1)
    other = state_errors(problem, fitted, alternative=True)
    drift = build_drift(other, problem.magnitude)
    params = np.concatenate([drift.constant, drift.coefficients.ravel()])
    found = average_over_term(params, drift.covariance, slice(3, None), DRIFTING)
    end = evaluate_spline(np.array([drift.stop]), drift.knots) - drift.middle
    by = np.kron(np.eye(3), end) / problem.magnitude
    moved = by @ found.params[3:]
    covariance = estimate.solution.covariance.copy()
    covariance[:3, :3] += np.outer(moved, moved) + by @ found.covariance[3:, 3:] @ by.T
    return estimate._replace(solution=estimate.solution._replace(covariance=covariance))
