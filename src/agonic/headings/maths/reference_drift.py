"""A reference that may drift over a swing, averaged over instead of tested for.

A gyro or a bearing that drifts while the vehicle goes round once looks like A to E: what is left of
it in the residuals of eight or twelve headings is too little for a test to see.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation.leastsq import inverse

DRIFTING = 0.18
"""How likely a reference that drifts is before the swing is seen: with it, intervals of 95 % of
swings without drift still hold 97 to 98 % (of B to E; A, which a drift moves most, more)."""
RATIOS = (1.0, 4.0, 16.0, 64.0, 256.0)
"""Variances of the drift, in those of a reading."""
LENGTH = 1.0
"""Over how many swings the drift keeps to itself: nearly a random walk."""
MOST = 100
"""With more readings their own correlation tells."""


class ReferenceDrift(NamedTuple):
    """Covariance (k, k) averaged over drift, and how likely a drift is."""

    covariance: Array
    probability: float


def average_over_drift(
    rows: Array, residuals: Array, covariance: Array, noise_deg: float | None = None
) -> ReferenceDrift:
    """The covariance of least squares whose errors may be correlated in the order of the readings.

    Errors with the covariance s² R, R = I + r exp(−|i − j|/l), have the restricted likelihood

        |R|^(−1/2) |XᵀR⁻¹X|^(−1/2) (eᵀR⁻¹e)^(−(n − k)/2)

    with s² = eᵀR⁻¹e/(n − k), or exp(−eᵀR⁻¹e/(2 s²)) in place of the last factor where the noise s
    of a reading is known. By it the covariances H s²R Hᵀ, H = (XᵀX)⁻¹Xᵀ, of all r are averaged
    (Hoeting et al. 1999). Rows X (n, k) and residuals are in the order they were taken.
    """
    n, k = rows.shape
    if n <= k or n > MOST:
        return ReferenceDrift(covariance, 0.0)
    slow, onto = _keep_over_swing(n), np.linalg.pinv(rows)
    scores, spreads = [], []
    for ratio in (0.0, *RATIOS):
        spread = np.eye(n) + ratio * slow
        score, variance = _score(rows, residuals, spread, noise_deg)
        scores.append(score)
        spreads.append(covariance if ratio == 0.0 else variance * onto @ spread @ onto.T)
    prior = np.array([1 - DRIFTING, *[DRIFTING / len(RATIOS)] * len(RATIOS)])
    likely = prior * np.exp(np.array(scores) - max(scores))
    likely /= likely.sum()
    averaged = np.einsum("r,rij->ij", likely, np.array(spreads))
    return ReferenceDrift(averaged, float(1 - likely[0]))


def add_drift(rows: Array, covariance: Array, drift_deg: float) -> Array:
    """The covariance (k, k) of rows X (n, k) with a drift of a known size added, H Q Hᵀ.

    `drift_deg` is the standard deviation of what the reference changes by from the first reading to
    the last.
    """
    slow, onto = _keep_over_swing(len(rows)), np.linalg.pinv(rows)
    ends = 2.0 * (slow[0, 0] - slow[0, -1])
    return np.asarray(covariance + drift_deg**2 / max(ends, 1e-12) * onto @ slow @ onto.T)


def _keep_over_swing(n: int) -> Array:
    """How much a drift keeps to itself from reading to reading, (n, n)."""
    place = np.arange(n)
    return np.asarray(np.exp(-np.abs(place[:, None] - place) / (LENGTH * n)))


def _score(
    rows: Array, residuals: Array, spread: Array, noise_deg: float | None
) -> tuple[float, float]:
    """Logarithm of the restricted likelihood, and the variance s² of a reading."""
    freedom = len(rows) - rows.shape[1]
    weight = inverse(spread)
    information = rows.T @ weight @ rows
    left = residuals - rows @ (inverse(information) @ (rows.T @ weight @ residuals))
    squares = max(float(left @ weight @ left), 1e-24)
    size = float(np.linalg.slogdet(spread)[1] + np.linalg.slogdet(information)[1])
    if noise_deg is not None:
        return -size / 2 - squares / (2 * noise_deg**2), noise_deg**2
    return -size / 2 - freedom / 2 * float(np.log(squares)), squares / freedom
