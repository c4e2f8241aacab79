"""The noise of each kind of residual: of the readings, and of the attitude beside it."""

from __future__ import annotations

import numpy as np

from agonic.maths.estimation.noise.residuals import Noise

_LARGEST = 1.0  # of the readings' noise over the field: what it bends residuals by would run away


def compute_spreads(noise: dict[str, Noise], before: dict[str, float]) -> dict[str, float]:
    """The noise of the readings, and for what is across the field that of the attitude over it.

    What a kind scatters by beyond the magnitude, σ²(1 + κ²) with the field about one, is the
    attitude's. `before` are those with which `noise` was found.
    """
    own = noise["magnitude"].sd
    found = {"magnitude": min(own, _LARGEST)}
    for kind, of in noise.items():
        if kind != "magnitude":
            whole = (of.sd / own) ** 2 * (1 + before[kind] ** 2)
            found[kind] = float(np.sqrt(max(whole - 1, 0.0)))
    return found


def compute_mean_correlation(noise: dict[str, Noise]) -> float:
    """One length for all kinds, so that they are weighted by their noise alone: how long errors
    last is known too poorly to choose between kinds, but each has its own in the covariance."""
    return float(np.mean([of.correlation for of in noise.values()]))


def rescale_noise(
    noise: Noise, kind: str, before: dict[str, float], now: dict[str, float]
) -> Noise:
    """The noise of residuals that are now over another √(1 + κ²)."""
    if kind == "magnitude":
        return noise
    return noise._replace(
        sd=noise.sd * float(np.sqrt((1 + before[kind] ** 2) / (1 + now[kind] ** 2)))
    )
