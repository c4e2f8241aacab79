"""A symmetric matrix and its six entries xx yy zz xy xz yz, the order of all parameters here."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array

ROWS, COLUMNS = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])
"""Where the six entries stand in the matrix."""


def pack_symmetric(matrix: Array) -> Array:
    """xx yy zz xy xz yz (…, 6) of matrices (…, 3, 3), from their upper triangle."""
    return np.asarray(matrix[..., ROWS, COLUMNS])


def unpack_symmetric(six: ArrayLike) -> Array:
    """The symmetric matrices (…, 3, 3) of xx yy zz xy xz yz (…, 6)."""
    values = np.asarray(six, dtype=np.float64)
    matrix = np.empty((*values.shape[:-1], 3, 3))
    matrix[..., ROWS, COLUMNS] = values
    matrix[..., COLUMNS, ROWS] = values
    return matrix
