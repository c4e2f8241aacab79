"""A zero of the gyro that moves while it is followed: seen, or only possible."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.maths.estimation.inference.model_averaging import average_over_term

DRIFTS = 3.0
"""Standard errors by which a drift of the zero stands out."""
LIKELY = 0.5
"""Probability of a drift before the readings are seen: gyros warm up."""


class Drift(NamedTuple):
    """How far the zero moves over the readings, its standard error, and what is to be allowed for,
    degrees; infinite where nothing tells it."""

    size_deg: float = 0.0
    sd_deg: float = float("inf")
    allowed_deg: float = 0.0

    @property
    def seen(self) -> bool:
        """Whether the zero moves by more than chance."""
        return abs(self.size_deg) > DRIFTS * self.sd_deg


NOT_TOLD = Drift()


def estimate_drift(size_deg: float, sd_deg: float) -> Drift:
    """A drift that was found with a standard error, averaged over its being there and not.

    >>> estimate_drift(5.0, 1.0).seen, round(estimate_drift(5.0, 1.0).allowed_deg, 1)
    (True, 4.9)
    >>> estimate_drift(0.5, 1.0).allowed_deg
    0.0
    """
    if not np.isfinite(sd_deg) or not sd_deg > 0:
        return Drift(size_deg, sd_deg)
    found = average_over_term(np.array([size_deg]), np.array([[sd_deg**2]]), slice(0, 1), LIKELY)
    allowed = np.hypot(found.params[0], np.sqrt(max(found.covariance[0, 0], 0.0)))
    return Drift(size_deg, sd_deg, float(allowed))
