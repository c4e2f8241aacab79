"""Errors that outlast noise and are over long before an orbit is: a current that switches.

Without a ground calibration nine numbers take up its mean, and no spline of the bias follows what
comes and goes within minutes: what is left is correlated in the residuals. The models of the field
err for longer, by less, or in axes that do not turn with the sensor.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from agonic.health import Finding, figure
from agonic.inflight.fit.covariance import OF_SENSOR

if TYPE_CHECKING:
    from agonic.inflight.fit.problem import Problem
    from agonic.inflight.fit.solve import Estimate

SHORT_S, SHORTEST_S = 900.0, 60.0
"""A sixth of a low orbit, for errors in the axes of the sensor; for others a minute."""
LARGE = 1e-3
"""Of the field: more than crust and polar currents leave along the field but seldom."""
SHARE = 0.25
"""Of the standard deviation of a residual."""


def measure_short_error(estimate: Estimate) -> float:
    """Standard deviation of the short errors of the magnitude over the field; 0 where small."""
    variance = 0.0
    for error in estimate.errors.get("magnitude", ()):
        limit = SHORT_S if error.geometry == OF_SENSOR else SHORTEST_S
        variance += error.variance * (error.time_s < limit)
    sd = float(np.sqrt(variance))
    return sd if sd > max(LARGE, SHARE * estimate.noise["magnitude"].sd) else 0.0


def allow_for_short_errors(estimate: Estimate) -> Estimate:
    """The estimate with what comes and goes in the covariance of the bias.

    The bias found is that of the mean, and at any moment it is off by what is switched on then.
    """
    sd = measure_short_error(estimate)
    if not sd:
        return estimate
    covariance = estimate.solution.covariance.copy()
    covariance[:3, :3] += sd**2 * np.eye(3)
    return estimate._replace(solution=estimate.solution._replace(covariance=covariance))


def judge_short_errors(estimate: Estimate, problem: Problem) -> list[Finding]:
    """That something comes and goes, and by how much."""
    sd = measure_short_error(estimate)
    if not sd:
        return []
    return [
        Finding(
            "switching current",
            "check",
            f"residuals hold {figure(sd * problem.magnitude)} nT that outlast noise and are gone "
            "within minutes, as a current does that switches and that nothing recorded; the "
            "bias' standard error contains it",
            "record the currents on board and fit with them (--with), or leave out when they "
            "flowed",
        )
    ]
