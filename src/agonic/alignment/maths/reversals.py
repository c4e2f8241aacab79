"""North from the turning points of a hanging gyro, and whether its zero drifts meanwhile."""

from __future__ import annotations

import numpy as np

from agonic.alignment.maths.north import North, regress
from agonic.arrays import Array
from agonic.maths.estimation.noise.student import compute_widening

FOUR = 4
"""Turning points that tell a drift, where one's noise is known, but no bend of the decay."""
_SCHULER = np.array([0.25, 0.5, 0.25])


def compute_schuler_means(turning: Array) -> Array:
    """N_i = (u_i + 2 u_{i+1} + u_{i+2})/4 of turning points (n,), (n − 2,).

    Free of the amplitude and, to first order, of its decay.

    >>> compute_schuler_means(np.array([10.0, 2.0, 8.0, 3.0])).tolist()
    [5.5, 5.25]
    """
    return np.convolve(turning, _SCHULER, mode="valid")


def fit_reversals(turning: Array, reading_sd: float | None = None) -> North:
    """North of n ≥ 3 turning points: the mean of the Schuler means, its standard error from their
    spread.

    Neighbouring means share readings. With M (n − 2, n) from readings to means and Q what centres
    them, E Σ(N_i − N̄)² = σ² tr(QMMᵀ), and N̄ = wᵀu has the variance σ² wᵀw. With a single mean, or
    a `reading_sd` that is stated, σ is that, unless the turning points scatter by more about
    u_i = N + (−1)ⁱ (a + b i).

    >>> fit_reversals(np.array([10.0, 2.0, 8.0, 3.0])).reading_deg
    5.375
    """
    n, means = len(turning), compute_schuler_means(turning)
    m = len(means)
    onto = np.stack([np.convolve(row, _SCHULER, mode="valid") for row in np.eye(n)], axis=1)
    weight = onto.mean(axis=0)
    centred = onto - weight
    variance = (
        reading_sd**2
        if reading_sd
        else float(((means - means.mean()) ** 2).sum() / (centred**2).sum())
        * compute_widening(m - 1) ** 2
        if m > 1
        else np.nan
    )
    excess = 1.0
    if reading_sd:
        sign, step = (-1.0) ** np.arange(n), np.arange(n) - (n - 1) / 2
        excess = regress(
            np.stack([np.ones(n), sign, sign * step], axis=1), turning, reading_sd
        ).excess
    sd = excess * float(np.sqrt(variance * (weight @ weight)))
    drift = _fit_drift(turning, reading_sd)
    return North(float(means.mean()), sd, m - 1, excess, *drift)


def _fit_drift(turning: Array, reading_sd: float | None) -> tuple[float, float]:
    """How far N moves from the first turning point to the last, and its standard error.

    u_i = N + d i/(n − 1) + (−1)ⁱ (a + b i + c i²): the decay of the amplitude is smooth. Of four
    turning points c is that of a steady decay, b²/2a. The noise is the stated one, or what is left,
    and more where more is left.
    """
    n = len(turning)
    along = np.linspace(-0.5, 0.5, n)
    sign = (-1.0) ** np.arange(n)
    design = np.stack([np.ones(n), sign, sign * along, along], axis=1)
    if n == FOUR:
        _, a, b, _ = np.linalg.solve(design, turning)
        turning = turning - sign * along**2 * (b * b / (2 * a) if a else 0.0)
    else:
        design = np.column_stack([design, sign * along**2])
    if n - design.shape[1] < (0 if reading_sd else 1):
        return 0.0, float("inf")
    line = regress(design, turning, reading_sd)
    return float(line.found[3]), float(np.sqrt(line.covariance[3, 3]))
