"""What residuals hide of the bias, in its standard errors: a drift, the sunlight, a current."""

from __future__ import annotations

from agonic.health import Finding
from agonic.inflight.fit.orbit_errors import judge_sunlight
from agonic.inflight.fit.problem import Problem
from agonic.inflight.fit.short_errors import allow_for_short_errors, judge_short_errors
from agonic.inflight.fit.solve import Estimate
from agonic.inflight.fit.sunlight import allow_for_sunlight
from agonic.inflight.fit.unseen_drift import allow_for_unseen_drift


def allow_for_unseen(problem: Problem, estimate: Estimate) -> tuple[Estimate, tuple[Finding, ...]]:
    """The estimate with a covariance grown by what its residuals do not show, and what is said.

    Of a record that is fitted in pieces, `problem` holds the rows in memory.
    """
    estimate = allow_for_unseen_drift(problem, estimate)
    estimate, sunlight = allow_for_sunlight(problem, estimate)
    estimate = allow_for_short_errors(estimate)
    return estimate, (*judge_sunlight(sunlight), *judge_short_errors(estimate, problem))
