"""What residuals hide of the bias, in its standard errors: a drift, the sunlight, a current."""

from __future__ import annotations

import numpy as np

from agonic.health import Finding
from agonic.inflight.fit.calibration import build_drift
from agonic.inflight.fit.drift import evaluate_spline
from agonic.inflight.fit.orbit_errors import judge_sunlight
from agonic.inflight.fit.problem import Problem
from agonic.inflight.fit.short_errors import allow_for_short_errors, judge_short_errors
from agonic.inflight.fit.solve import Estimate, find_start, fit_rows, state_errors
from agonic.inflight.fit.sunlight import allow_for_sunlight
from agonic.maths.estimation.inference.model_averaging import average_over_term


def allow_for_unseen(problem: Problem, estimate: Estimate) -> tuple[Estimate, tuple[Finding, ...]]:
    """The estimate with a covariance grown by what its residuals do not show, and what is said.

    Of a record that is fitted in pieces, `problem` holds the rows in memory.
    """
    estimate = allow_for_unseen_drift(problem, estimate)
    estimate, sunlight = allow_for_sunlight(problem, estimate)
    estimate = allow_for_short_errors(estimate)
    return estimate, (*judge_sunlight(sunlight), *judge_short_errors(estimate, problem))


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
