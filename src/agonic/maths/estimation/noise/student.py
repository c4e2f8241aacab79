"""Standard errors whose noise few residuals have told: as wide as Student's t has it."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtrc, ndtri, stdtrit

RARE = 1e-3
"""Chance of a scatter below which the stated noise of a reading is not believed."""


def compute_widening(freedom: float) -> float:
    """The interval of 95 % by Student's t over that of a normal distribution, ≥ 1.

    A standard error s of a noise with few degrees of freedom, times this, holds 95 % of all
    errors within 1.96 of it, as one with a known noise does. NaN without any freedom."""
    if not freedom > 0:
        return float("nan")
    return float(stdtrit(min(freedom, 1e6), 0.975) / ndtri(0.975))


def exceed_stated(squares: float, freedom: int, stated_sd: float) -> float:
    """How many times the stated noise residuals scatter, widened by Student's t; else 1."""
    chi2 = squares / stated_sd**2
    if freedom < 1 or chdtrc(freedom, chi2) > RARE:
        return 1.0
    return float(np.sqrt(chi2 / freedom)) * compute_widening(freedom)
