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
from agonic.model.average import Group, average_estimate
from agonic.model.terms.time import BIAS_DRIFT


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
    """The estimate averaged over how large its drift is; that of a bias that was chosen to be
    constant grown by the drift that it may have.

    The calibration is that at the end of the record, and so is what the drift adds to it. Nothing
    changes where a number of no intervals was given.
    """
    if estimate.terms.splines:
        solution, layout = estimate.solution, estimate.layout
        own = layout.biases(np.arange(layout.parameters))[:, : estimate.terms.splines]
        term = Group(
            "drift", own.ravel().astype(np.intp), BIAS_DRIFT.scale, 1 - 1e-9, BIAS_DRIFT.most
        )
        params, covariance, *_ = average_estimate(solution.params, solution.covariance, term)
        return estimate._replace(solution=solution._replace(params=params, covariance=covariance))
    if 1 not in estimate.held_out:
        return estimate
    fitted = fit_rows(problem, find_start(problem), problem.used, 1)
    other = state_errors(problem, fitted, alternative=True)
    drift = build_drift(other, problem.magnitude)
    params = np.concatenate([drift.constant, drift.coefficients.ravel()]) / problem.magnitude
    term = Group("drift", np.arange(3, len(params)), BIAS_DRIFT.scale, DRIFTING, BIAS_DRIFT.most)
    mean, spread, *_ = average_estimate(params, drift.covariance / problem.magnitude**2, term)
    end = evaluate_spline(np.array([drift.stop]), drift.knots) - drift.middle
    by = np.kron(np.eye(3), end)
    moved = by @ mean[3:]
    covariance = estimate.solution.covariance.copy()
    covariance[:3, :3] += np.outer(moved, moved) + by @ spread[3:, 3:] @ by.T
    return estimate._replace(solution=estimate.solution._replace(covariance=covariance))
