"""How large the lean of a tilt's sensor, fixed in body axes, is by the dip.

An accelerometer's bias b leans the vertical by ⟨R b⟩/g. Its part in the magnetic meridian shows as
a dip that is off, another one on each heading; its part across turns the compass unseen:

    dip − expected = ⟨R⟩_north·ℓ + c + noise,   ℓ ~ N(0, s²),   ℓ = b/g

How large s is, the dip tells by its marginal likelihood (expectation and maximisation; Dempster,
Laird & Rubin 1977). What an axis does not show is taken to be as large as what the others show.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Mask
from agonic.maths.estimation.noise.residuals import MAD_TO_SD, correlation_length

CLIP = 3.0
"""Residuals further out than so many robust sds count as these: a magnet is no tilt."""
FEWEST = 30
"""Moments or rows that tell a lean, or a scatter, at least."""


def find_lean_covariance(
    time: Array, residual: Array, north: Array, good: Mask, sd: float, other_sd: float
) -> Array:
    """The covariance (3, 3) of a lean in body axes, rad², at least that of `sd` on each axis.

    The likeliest lean is counted, not undone: what follows the heading by itself looks the same.

    `residual` (N,) is the dip less the expected one, `north` (N, 3) what a lean adds to the north
    of the vertical; `sd`, rad, is known of the lean beforehand, and stays beside what is found: no
    number of rows makes an error that lasts smaller. Errors of the calibration add `other_sd` to
    the dip, rad, which may look the same on all headings.
    """
    unknown = sd**2 * np.eye(3)
    if good.sum() < FEWEST:
        return unknown
    y, rows = residual[good], np.column_stack([north[good], np.ones(int(good.sum()))])
    apart = np.abs(y - np.median(y))
    limit = CLIP * MAD_TO_SD * float(np.median(apart)) + 1e-6
    y = np.median(y) + np.clip(y - np.median(y), -limit, limit)
    normal, pull = rows.T @ rows, rows.T @ y
    first = np.linalg.solve(normal + 1e-3 * np.eye(4), pull)
    left = y - rows @ first
    alike = max(
        correlation_length(left, np.ones(len(left))),
        5.0 / max(float(np.median(np.diff(time[good]))), 1e-9),
    )
    weight = 1.0 / (float(left @ left) / len(left) * alike + 1e-12)
    # the offset is integrated out
    # of the dip that is expected, rad: a world model does not know what is in the ground
    shown = normal[3, 3] * weight + float(np.radians(0.5)) ** -2
    told = weight * normal[:3, :3] - np.outer(normal[:3, 3], normal[3, :3]) * weight**2 / shown
    right = weight * pull[:3] - weight**2 * normal[:3, 3] * pull[3] / shown
    # errors of the calibration are alike on all headings
    damped = np.linalg.inv(np.eye(3) + other_sd**2 * told)
    told, right = damped @ told, damped @ right
    size = sd
    for _ in range(100):
        covariance = np.linalg.inv(told + np.eye(3) / size**2)
        mean = covariance @ right
        size = max(float(np.sqrt((mean @ mean + np.trace(covariance)) / 3.0)), sd)
    lasting = (covariance + covariance.T) / 2 + np.outer(mean, mean) + unknown

    def score(size: float) -> float:
        """Twice the logarithm of the marginal likelihood of leans of such a size over none."""
        spread = float(np.linalg.slogdet(np.eye(3) + size**2 * told)[1])
        return float(right @ np.linalg.solve(told + np.eye(3) / size**2, right)) - spread

    # twice the gain of the log likelihood that a lean beyond the known one needs: χ² of one, 1 %
    return np.asarray(lasting) if score(size) - score(sd) > 6.6 else unknown
