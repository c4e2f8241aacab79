"""Whittaker's smoother, as smooth as the readings allow by generalised cross-validation.

It minimises Σ (z − y)² + s Σ (second differences of z)², the stiffness s being that of the least
generalised cross-validation.

Source: Eilers 2003; Craven & Wahba 1979.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import solveh_banded

from agonic.arrays import Array

FEWEST = 16
"""Values below which nothing is smoothed."""
_GRID = np.pi * (np.arange(2048) + 0.5) / 2048


class Smoothed(NamedTuple):
    """Values (n,) and the share of their noise's variance that is left in them."""

    values: Array
    freedom: float


def smooth(values: Array) -> Smoothed:
    """Values (n,) at equal steps, as smooth as they allow."""
    stiffness = _find_stiffness(values)
    return Smoothed(_solve(values, stiffness), _share_of_freedom(stiffness))


def _solve(values: Array, stiffness: float) -> Array:
    """Solve (1 + s DᵀD) z = y, D the second differences."""
    n = len(values)
    bands = np.zeros((3, n))
    bands[0, 2:] = stiffness
    bands[1, 1:] = -4 * stiffness
    bands[1, [1, -1]] = -2 * stiffness
    bands[2] = 1 + 6 * stiffness
    bands[2, [0, -1]] = 1 + stiffness
    bands[2, [1, -2]] = 1 + 5 * stiffness
    return np.asarray(solveh_banded(bands, values, overwrite_ab=True, check_finite=False))


def _share_of_freedom(stiffness: float) -> float:
    """The trace of the smoother over the number of readings, for many of them."""
    return float(np.mean(1 / (1 + stiffness * (2 - 2 * np.cos(_GRID)) ** 2)))


def _find_stiffness(values: Array) -> float:
    """The stiffness of the least generalised cross-validation."""
    from scipy.optimize import minimize_scalar  # slow to load

    def cost(log: float) -> float:
        stiffness = float(np.exp(log))
        left = values - _solve(values, stiffness)
        return float(np.mean(left**2)) / (1 - _share_of_freedom(stiffness)) ** 2

    found = minimize_scalar(cost, bounds=(0.0, 25.0), method="bounded", options={"xatol": 0.3})
    return float(np.exp(found.x))
