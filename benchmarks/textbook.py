"""Estimators as textbooks and autopilots have them, for comparison."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from agonic.maths.equation.affine import correct, model_basis, split

Array = NDArray[np.float64]


def diagonal(raw: Array, magnitude: float) -> tuple[Array, Array]:
    """Bias and three gains by one linear least-squares step.

    H = [x y z −y² −z² 1], w = x², X = H⁺w; x₀ = X₁/2, y₀ = X₂/(2 X₄), z₀ = X₃/(2 X₅);
    A = X₆ + x₀² + X₄y₀² + X₅z₀², B = A/X₄, C = A/X₅; semi-axes √A, √B, √C. The readings are
    centred and scaled first, without which it often fails.
    """
    centre, size = _middle(raw)
    x, y, z = ((raw - centre) / size).T
    rows = np.stack([x, y, z, -(y**2), -(z**2), np.ones_like(x)], axis=1)
    x1, x2, x3, x4, x5, x6 = np.linalg.lstsq(rows, x**2, rcond=None)[0]
    middle = np.array([x1 / 2, x2 / (2 * x4), x3 / (2 * x5)])
    square = x6 + middle**2 @ [1.0, x4, x5]
    squares = square / np.array([1.0, x4, x5])
    if not (squares > 0).all():
        raise ValueError("not an ellipsoid")
    return centre + size * middle, np.diag(magnitude / (size * np.sqrt(squares)))


def magnitude_residual(raw: Array, magnitude: float) -> tuple[Array, Array]:
    """Bias and symmetric W of least Σ (|W(raw − bias)| − F)², by Levenberg–Marquardt.

    The residual that autopilots minimise: a difference of magnitudes, not a distance among the
    readings, where the noise is.
    """
    basis = model_basis("full")
    centre, size = _middle(raw)
    points = (raw - centre) / size

    def residuals(params: Array) -> Array:
        field = correct(points, *split(basis @ params))
        return np.asarray(np.linalg.norm(field, axis=1) - 1.0)

    def jacobian(params: Array) -> Array:
        bias, matrix = split(basis @ params)
        d = points - bias
        u = d @ matrix.T
        unit = u / np.linalg.norm(u, axis=1, keepdims=True)
        by_matrix = (unit[:, :, None] * d[:, None, :]).reshape(-1, 9)
        return np.hstack([-unit @ matrix, by_matrix]) @ basis

    found = least_squares(
        residuals, _sphere(points), jac=jacobian, method="lm", x_scale="jac", max_nfev=100
    )
    if not found.success:
        raise ValueError("no convergence")
    bias, matrix = split(basis @ found.x)
    return centre + size * bias, matrix * magnitude / size


def _sphere(points: Array) -> Array:
    """Where autopilots start: the nine parameters of the sphere |p|² = 2 c·p + t."""
    rows = np.hstack([2 * points, np.ones((len(points), 1))])
    *centre, t = np.linalg.lstsq(rows, np.sum(points**2, axis=1), rcond=None)[0]
    gain = 1 / np.sqrt(t + np.dot(centre, centre))
    return np.array([*centre, gain, gain, gain, 0.0, 0.0, 0.0])


def _middle(raw: Array) -> tuple[Array, float]:
    """Mean of the readings and their rms distance from it."""
    centre = raw.mean(axis=0)
    return centre, float(np.sqrt(((raw - centre) ** 2).sum(axis=1).mean()))
