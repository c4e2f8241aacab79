"""A parameter of the shape of a term, from a fit with the term and its derivative side by side."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array


def find_move(terms: Array, slopes: Array, covariance: Array) -> tuple[float, float]:
    """How far to move a parameter θ of x(θ), and the standard error.

        K (x + x' δ) = K x + S x',   so   δ = (kᵀ C⁻¹ s) / (kᵀ C⁻¹ k),   sd² = 1 / (kᵀ C⁻¹ k)

    Parameters: `terms` (m,), the coefficients K of x; `slopes` (m,), those S of x' = ∂x/∂θ;
    `covariance` (m, m) of the slopes.

    >>> find_move(np.array([2.0, 4.0]), np.array([0.2, 0.4]), np.eye(2) * 0.2)
    (0.1, 0.1)
    """
    weighted = np.linalg.solve(covariance, terms)
    information = float(terms @ weighted)
    return float(slopes @ weighted) / information, information**-0.5
