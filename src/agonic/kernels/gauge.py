"""Moving a bias, a symmetric matrix and their covariance between scales, models and gauges.

Parameters are bias x y z, then matrix xx yy zz xy xz yz; covariances are (9, 9) of these.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from agonic.kernels.leastsq import inverse

Array = NDArray[np.float64]

_ROWS, _COLUMNS = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])


def entries(matrix: Array) -> Array:
    """xx yy zz xy xz yz of a matrix, (6,)."""
    return np.asarray(matrix[_ROWS, _COLUMNS])


def spread_model(model: str, covariance: Array) -> Array:
    """Covariance (9, 9) from that of a model's own parameters (4, 6 or 9)."""
    if model == "full":
        return covariance
    spread = np.zeros((9, len(covariance)))
    spread[:3, :3] = np.eye(3)
    spread[3:6, 3:] = np.ones((3, 1)) if model == "sphere" else np.eye(3)
    return np.asarray(spread @ covariance @ spread.T)


def scaled(covariance: Array, bias_scale: float, matrix_scale: float) -> Array:
    """Covariance after bias and matrix were multiplied by their scales."""
    size = np.array([bias_scale] * 3 + [matrix_scale] * 6)
    return covariance * np.outer(size, size)


def mean_gain_one(matrix: Array, covariance: Array) -> tuple[Array, Array, float]:
    """Matrix over k = tr W/3, its covariance, and k: for readings without a known magnitude."""
    gain = float(np.trace(matrix) / 3)
    toward = np.array([1.0, 1, 1, 0, 0, 0]) / 3
    change = np.eye(9)
    change[3:, 3:] = (np.eye(6) - np.outer(entries(matrix) / gain, toward)) / gain
    spread = change @ covariance @ change.T
    exact = np.diag(spread)[3:] < 1e-24  # a sphere's entries are exactly 1 now, but for rounding
    spread[3:][exact], spread[:, 3:][:, exact] = 0.0, 0.0
    return matrix / gain, spread, gain


def triangular(matrix: Array, covariance: Array) -> tuple[Array, Array]:
    """The upper-triangular matrix with the same WᵀW (z axis kept), and the covariance of it.

    U = chol(WᵀW)ᵀ turns the calibrated field rigidly so that its z component depends on the
    sensor's z axis alone.
    """

    def upper(flat: Array) -> Array:
        w = np.empty((3, 3))
        w[_ROWS, _COLUMNS] = flat
        w[_COLUMNS, _ROWS] = flat
        return np.asarray(np.linalg.cholesky(w.T @ w).T)

    flat = entries(matrix)
    step = 1e-6 * float(np.trace(matrix) / 3)
    change = np.eye(9)
    for k, direction in enumerate(np.eye(6) * step):
        ahead, behind = entries(upper(flat + direction)), entries(upper(flat - direction))
        change[3:, 3 + k] = (ahead - behind) / (2 * step)
    return upper(flat), change @ covariance @ change.T


def soft_iron_tests(matrix: Array, covariance: Array) -> list[tuple[str, str, float, float]]:
    """Wald tests of smaller models within the full one: (smaller, larger, χ², p), smallest first.

    sphere in full: equal gains and no off-diagonals, five conditions; diagonal in full: three.
    """
    conditions = np.zeros((5, 6))
    conditions[:2, :3] = [[1, -1, 0], [0, 1, -1]]
    conditions[2:, 3:] = np.eye(3)
    tests = []
    for smaller, rows in (("sphere", conditions), ("diagonal", conditions[2:])):
        difference = rows @ entries(matrix)
        spread = rows @ covariance[3:, 3:] @ rows.T
        statistic = float(difference @ inverse(spread) @ difference)
        tests.append((smaller, "full", statistic, float(chdtrc(len(rows), statistic))))
    return tests
