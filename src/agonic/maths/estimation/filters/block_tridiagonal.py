"""Symmetric systems whose blocks couple neighbours only: a state for each moment of a record.

H = [[D₀, B₀ᵀ], [B₀, D₁, B₁ᵀ], [B₁, D₂, …]]
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import solveh_banded

from agonic.arrays import Array


class Tridiagonal(NamedTuple):
    """The blocks on the diagonal, (N, b, b), and those below it, (N − 1, b, b)."""

    diagonal: Array
    below: Array


def solve(matrix: Tridiagonal, right: Array) -> Array:
    """H⁻¹ right of right sides (N, b, c).

    >>> one = Tridiagonal(np.tile(2 * np.eye(1), (3, 1, 1)), np.tile(-np.eye(1), (2, 1, 1)))
    >>> solve(one, np.ones((3, 1, 1))).ravel().round(9).tolist()
    [1.5, 2.0, 1.5]
    """
    flat = right.reshape(len(matrix.diagonal) * matrix.diagonal.shape[1], -1)
    found = solveh_banded(stack_band(matrix), flat, lower=True, check_finite=False)
    return np.asarray(found.reshape(right.shape))


def stack_band(matrix: Tridiagonal) -> Array:
    """The lower band of H, [i − j, j], as LAPACK and SciPy take it.

    >>> stack_band(Tridiagonal(np.full((2, 1, 1), 2.0), -np.ones((1, 1, 1)))).tolist()
    [[2.0, 2.0], [-1.0, 0.0]]
    """
    count, size, _ = matrix.diagonal.shape
    band = np.zeros((2 * size, count, size))
    for row in range(size):
        for column in range(size):
            if row >= column:
                band[row - column, :, column] = matrix.diagonal[:, row, column]
            band[size + row - column, :-1, column] = matrix.below[:, row, column]
    return band.reshape(2 * size, -1)


def invert(matrix: Tridiagonal) -> Tridiagonal:
    """The same blocks of H⁻¹ (Rauch, Tung & Striebel's smoother; Takahashi's equations).

    >>> one = Tridiagonal(np.tile(2 * np.eye(1), (3, 1, 1)), np.tile(-np.eye(1), (2, 1, 1)))
    >>> invert(one).diagonal.ravel().round(9).tolist(), invert(one).below.ravel().round(9).tolist()
    ([0.75, 1.0, 0.75], [0.5, 0.5])
    """
    count = len(matrix.diagonal)
    gains = np.empty_like(matrix.below)
    forward = np.empty_like(matrix.diagonal)
    forward[0] = np.linalg.inv(matrix.diagonal[0])
    for k in range(count - 1):
        gains[k] = matrix.below[k] @ forward[k]
        forward[k + 1] = np.linalg.inv(matrix.diagonal[k + 1] - gains[k] @ matrix.below[k].T)
    found, below = forward, np.empty_like(gains)
    for k in range(count - 2, -1, -1):
        below[k] = -found[k + 1] @ gains[k]
        found[k] -= gains[k].T @ below[k]
    return Tridiagonal(found, below)
