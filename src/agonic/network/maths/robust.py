"""Least squares with a prior, whose noise is found from its own residuals."""

from __future__ import annotations

from agonic.arrays import Array
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.residuals import Noise, estimate_noise

_ROUNDS = 6


def solve_with_noise(
    pieces: leastsq.Pieces,
    start: Array,
    *,
    scale: float,
    prior: leastsq.Prior,
    robust: bool = True,
) -> tuple[leastsq.Solution, Noise]:
    """The minimum from a start (m,), and the noise and correlation that it was weighted by.

    Parameters: `scale` of the residuals at first; `robust` down-weights outliers.
    """
    solution = leastsq.solve(pieces, start, scale=scale, prior=prior)
    noise = estimate_noise(solution.residuals, robust, len(start))
    for _ in range(_ROUNDS):
        solution = leastsq.solve(
            pieces,
            solution.params,
            scale=noise.sd,
            loss=noise.loss,
            prior=prior,
            correlation=noise.correlation,
        )
        found = estimate_noise(solution.residuals, robust, len(start))
        if found.settled(noise):
            break
        noise = found
    return solution, noise
