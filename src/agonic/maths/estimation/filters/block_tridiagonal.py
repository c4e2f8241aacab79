"""Symmetric systems whose blocks couple neighbours only: a state for each moment of a record.

H = [[D₀, B₀ᵀ], [B₀, D₁, B₁ᵀ], [B₁, D₂, …]]
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded

from agonic.arrays import Array


class Tridiagonal(NamedTuple):
    """The blocks on the diagonal, (N, b, b), and those below it, (N − 1, b, b)."""

    diagonal: Array
    below: Array


def solve(matrix: Tridiagonal, right: Array) -> tuple[Array, float]:
    """H⁻¹ right of right sides (N, b, c), and log det H."""
    flat = right.reshape(len(matrix.diagonal) * matrix.diagonal.shape[1], -1)
    factor = cholesky_banded(stack_band(matrix), lower=True, check_finite=False)
    found = cho_solve_banded((factor, True), flat, check_finite=False)
    return np.asarray(found.reshape(right.shape)), 2 * float(np.log(factor[0]).sum())


def stack_band(matrix: Tridiagonal) -> Array:
    """The lower band of H, [i − j, j], as LAPACK and SciPy take it."""
    count, size, _ = matrix.diagonal.shape
    band = np.zeros((2 * size, count, size))
    for row in range(size):
        for column in range(size):
            if row >= column:
                band[row - column, :, column] = matrix.diagonal[:, row, column]
            band[size + row - column, :-1, column] = matrix.below[:, row, column]
    return band.reshape(2 * size, -1)


def invert(matrix: Tridiagonal) -> Tridiagonal:
    """The same blocks of H⁻¹, by cyclic reduction.

    Every second state is eliminated at once, what is left is tridiagonal again; its blocks of the
    inverse give those of the states between (Heller 1976; Takahashi's equations)."""
    count = len(matrix.diagonal)
    own: Array = np.asarray(np.linalg.inv(matrix.diagonal[::2]), dtype=np.float64)
    if count == 1:
        return Tridiagonal(own, matrix.below)
    up = np.swapaxes(matrix.below[::2], 1, 2)  # from the state after to the one that goes
    down = matrix.below[1::2]  # from the state before
    after, before = own[: len(up)] @ up, own[1 : 1 + len(down)] @ down
    left = matrix.diagonal[1::2] - np.swapaxes(up, 1, 2) @ after
    left[: len(down)] -= np.swapaxes(down, 1, 2) @ before
    joined = -np.swapaxes(up[1:], 1, 2) @ before[: len(up) - 1]
    kept = invert(Tridiagonal(left, joined))
    shape = matrix.diagonal.shape
    diagonal, below = np.empty(shape), np.empty((count - 1, *shape[1:]))
    diagonal[1::2] = kept.diagonal
    above = -after @ kept.diagonal  # of the states that went, with those after them
    beside = -before @ kept.diagonal[: len(down)]  # and with those before them
    both = min(len(up) - 1, len(down))
    above[1 : 1 + both] -= before[:both] @ np.swapaxes(kept.below[:both], 1, 2)
    beside[:both] -= after[1 : 1 + both] @ kept.below[:both]
    own[: len(up)] -= above @ np.swapaxes(after, 1, 2)
    own[1 : 1 + len(down)] -= beside @ np.swapaxes(before, 1, 2)
    diagonal[::2], below[::2], below[1::2] = own, np.swapaxes(above, 1, 2), beside
    return Tridiagonal(diagonal, below)
