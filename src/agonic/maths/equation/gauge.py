"""Moving a bias, a symmetric matrix and their covariance between scales, models and gauges.

Parameters are bias x y z, then matrix xx yy zz xy xz yz; covariances are (9, 9) of these. All
broadcast over leading axes: a covariance may be (…, 9, 9).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.special import chdtrc

from agonic.arrays import Array
from agonic.maths.equation.affine import ELLIPSE, model_basis
from agonic.maths.equation.symmetric import pack_symmetric, unpack_symmetric
from agonic.maths.estimation.leastsq import inverse


def mean_gain(matrix: Array) -> Any:
    """tr W / 3, (…)."""
    return np.trace(matrix, axis1=-2, axis2=-1) / 3


_PARAMETERS = [0, 1, 2, 3, 7, 11, 4, 5, 8]
"""Bias x y z and matrix xx yy zz xy xz yz among the twelve local numbers."""


def expand_model_covariance(model: str, covariance: Array) -> Array:
    """Covariance (9, 9) from that of a model's own parameters; 0 along z of the bias of an ellipse,
    of which two axes show nothing."""
    if model == "full":
        return covariance
    spread = model_basis(model)[_PARAMETERS]
    if model == ELLIPSE:
        spread = spread * (np.arange(9) != 2)[:, None]
    return np.asarray(spread @ covariance @ spread.T)


def scale_covariance(
    covariance: Array, bias_scale: Array | float, matrix_scale: Array | float
) -> Array:
    """Covariance after bias and matrix were multiplied by their scales, (…)."""
    scales = np.broadcast_arrays(bias_scale, matrix_scale)
    size = np.stack(scales, axis=-1)[..., [0] * 3 + [1] * 6]
    return np.asarray(covariance * (size[..., :, None] * size[..., None, :]))


def normalise_mean_gain(matrix: Array, covariance: Array) -> tuple[Array, Array, Any]:
    """Matrix over k = tr W/3, its covariance, and k: for readings without a known magnitude."""
    gain = mean_gain(matrix)
    k = np.asarray(gain)[..., None, None]
    toward = np.array([1.0, 1, 1, 0, 0, 0]) / 3
    change = np.zeros(covariance.shape)
    change[..., :3, :3] = np.eye(3)
    change[..., 3:, 3:] = (np.eye(6) - pack_symmetric(matrix)[..., :, None] / k * toward) / k
    spread = change @ covariance @ np.swapaxes(change, -1, -2)
    # a sphere's entries are exactly 1 now, but for rounding
    exact = np.diagonal(spread, axis1=-2, axis2=-1) < 1e-24
    exact = exact & (np.arange(9) >= 3)
    spread[exact[..., :, None] | exact[..., None, :]] = 0.0
    return matrix / k, spread, gain


class Units(NamedTuple):
    """From normalised points to readings: reading = centre + size · point, (…, 3) and (…).

    `magnitude` is what one stands for in the calibrated field, or None; `sd` its uncertainty.
    """

    centre: Array
    size: Any
    magnitude: float | None
    sd: float = 0.0


def convert_to_units(
    bias: Array, matrix: Array, covariance: Array, units: Units, gauge: str
) -> tuple[Array, Array, Array, Any]:
    """Bias, matrix and covariance of readings from those of normalised points, and the magnitude.

    Without a known magnitude the mean gain becomes one; the uncertainty of a known one stretches
    the matrix as a whole.
    """
    size = np.asarray(units.size)
    if units.magnitude is None:
        matrix, covariance, gain = normalise_mean_gain(matrix, covariance)
        factor, magnitude = np.ones(size.shape), units.size / gain
    else:
        factor, magnitude = units.magnitude / size, units.magnitude
    matrix = matrix * factor[..., None, None]
    covariance = scale_covariance(covariance, size, factor)
    if units.magnitude is not None:
        stretch = np.zeros(covariance.shape[:-1])
        stretch[..., 3:] = pack_symmetric(matrix) * units.sd / magnitude
        covariance = covariance + stretch[..., :, None] * stretch[..., None, :]
    if gauge == "triangular":
        matrix, covariance = make_triangular(matrix, covariance)
    return units.centre + size[..., None] * bias, matrix, covariance, magnitude


def make_triangular(matrix: Array, covariance: Array) -> tuple[Array, Array]:
    """The upper-triangular matrix with the same WᵀW (z axis kept), and the covariance of it.

    U = chol(WᵀW)ᵀ turns the calibrated field rigidly so that its z component depends on the
    sensor's z axis alone.
    """

    def upper(flat: Array) -> Array:
        w = unpack_symmetric(flat)
        return np.swapaxes(np.linalg.cholesky(w @ w), -1, -2)

    flat = pack_symmetric(matrix)
    step = 1e-6 * np.asarray(mean_gain(matrix))[..., None]
    change = np.zeros(covariance.shape)
    change[..., :3, :3] = np.eye(3)
    for k, direction in enumerate(np.eye(6)):
        ahead = pack_symmetric(upper(flat + direction * step))
        behind = pack_symmetric(upper(flat - direction * step))
        change[..., 3:, 3 + k] = (ahead - behind) / (2 * step)
    return upper(flat), change @ covariance @ np.swapaxes(change, -1, -2)


def compare_soft_iron_models(matrix: Array, covariance: Array) -> list[tuple[str, str, Any, Any]]:
    """Wald tests of smaller models within the full one: (smaller, larger, χ², p), smallest first.

    χ² and p are (…), numbers for a single matrix.

    sphere in full: equal gains and no off-diagonals, five conditions; diagonal in full: three.
    """
    conditions = np.zeros((5, 6))
    conditions[:2, :3] = [[1, -1, 0], [0, 1, -1]]
    conditions[2:, 3:] = np.eye(3)
    tests = []
    for smaller, rows in (("sphere", conditions), ("diagonal", conditions[2:])):
        difference = pack_symmetric(matrix) @ rows.T
        spread = rows @ covariance[..., 3:, 3:] @ rows.T
        statistic = np.einsum("...i,...ij,...j", difference, inverse(spread), difference)[()]
        tests.append((smaller, "full", statistic, chdtrc(len(rows), statistic)))
    return tests
