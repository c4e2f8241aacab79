"""Least squares with a prior, whose noise is found from its own residuals."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.residuals import Noise, estimate_noise


def solve_with_noise(
    pieces: leastsq.Pieces,
    start: Array,
    *,
    scale: float,
    prior: leastsq.Prior,
    robust: bool = True,
    least: float = 1.0,
    tolerance: float = 1e-3,
) -> tuple[leastsq.Solution, Noise]:
    """The minimum from a start (m,), and the noise and correlation that it was weighted by: at
    least so many residuals count as one; `tolerance` of the steps is in standard errors."""
    solution = leastsq.solve(pieces, start, scale=scale, prior=prior, tolerance=tolerance)
    noise = estimate_noise(solution.residuals, robust, _count_determined(solution))
    for _ in range(6):
        solution = leastsq.solve(
            pieces,
            solution.params,
            scale=noise.sd,
            loss=noise.loss,
            prior=prior,
            correlation=max(noise.correlation, least),
            tolerance=tolerance,
        )
        found = estimate_noise(solution.residuals, robust, _count_determined(solution))
        if found.settled(noise):
            break
        noise = found
    return solution, noise


def _count_determined(solution: leastsq.Solution) -> int:
    """How many parameters the residuals determine beside the prior: γ = tr(information C)."""
    return round(float(np.vdot(solution.information, solution.covariance)))
