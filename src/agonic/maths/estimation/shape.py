"""A parameter of the shape of a term, from a fit with the term and its derivative side by side."""

from __future__ import annotations

from agonic.arrays import Array
from agonic.maths.estimation.leastsq import inverse


def find_move(terms: Array, slopes: Array, covariance: Array) -> tuple[float, float]:
    """How far to move a parameter θ of x(θ), and the standard error.

        K (x + x' δ) = K x + S x',   so   δ = (kᵀ C⁻¹ s) / (kᵀ C⁻¹ k),   sd² = 1 / (kᵀ C⁻¹ k)

    Parameters: `terms` (m,), the coefficients K of x; `slopes` (m,), those S of x' = ∂x/∂θ;
    `covariance` (m, m) of the slopes. An infinite standard error where the terms tell nothing.

    >>> import numpy as np
    >>> move, sd = find_move(np.array([2.0, 4.0]), np.array([0.2, 0.4]), np.eye(2) * 0.2)
    >>> f"{move:.3f}", f"{sd:.3f}"
    ('0.100', '0.100')
    """
    weighted = inverse(covariance) @ terms
    information = float(terms @ weighted)
    if not information > 0.0:
        return 0.0, float("inf")
    return float(slopes @ weighted) / information, information**-0.5
