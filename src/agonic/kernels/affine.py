"""The one equation, field = matrix @ (raw − bias), its residuals and their Jacobians.

A calibration has twelve local numbers: bias (3), then matrix row by row (9). Every residual
returns its Jacobian with respect to those twelve; a linear map (`model_basis`) reduces them to
the parameters of a model and gauge, and `with_covariates` spreads them over a basis of covariates.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SYMMETRIC = "symmetric"
TRIANGULAR = "triangular"

_ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # xx yy zz xy xz yz


def correct(raw: Array, bias: Array, matrix: Array) -> Array:
    """Apply the calibration, field = matrix @ (raw − bias); broadcasts over leading axes."""
    return np.asarray((raw - bias) @ np.swapaxes(matrix, -1, -2))


def model_basis(model: str, gauge: str = SYMMETRIC) -> Array:
    """The map from a model's parameters to the twelve local numbers, (12, m).

    `sphere` has bias and one gain, `diagonal` bias and three gains, `full` bias and the six
    entries xx yy zz xy xz yz of a matrix that is symmetric or upper triangular (z axis kept).
    """
    columns = [np.eye(12)[:, :3]]
    entries = np.zeros((12, 6))
    for k, (i, j) in enumerate(_ENTRIES):
        entries[3 + 3 * i + j, k] = 1.0
        if gauge == SYMMETRIC:
            entries[3 + 3 * j + i, k] = 1.0
    if model == "sphere":
        columns.append(entries[:, :3].sum(axis=1, keepdims=True))
    else:
        columns.append(entries[:, : {"diagonal": 3, "full": 6}[model]])
    return np.hstack(columns)


def split(local: Array) -> tuple[Array, Array]:
    """Bias (…, 3) and matrix (…, 3, 3) of the twelve local numbers (…, 12)."""
    return local[..., :3], local[..., 3:].reshape(*local.shape[:-1], 3, 3)


def join(bias: Array, matrix: Array) -> Array:
    """The twelve local numbers of a bias and a matrix."""
    return np.concatenate([bias, matrix.reshape(*matrix.shape[:-2], 9)], axis=-1)


def magnitude_residual(
    raw: Array, bias: Array, matrix: Array, magnitude: Array | float, noise_sd: float = 0.0
) -> tuple[Array, Array]:
    """How far each reading lies from the ellipsoid, as a distance in raw space, and its Jacobian.

    With d = raw − bias, u = W d, û = u/|u|, s = Wᵀû:

        r = (|u| − F) / |s|,   ∂r/∂bias = −Wᵀa,   ∂r/∂W = a dᵀ − (r/|s|) û nᵀ,
        n = s/|s|,  p = (I − ûûᵀ) W n,  a = (û − r p/|u|) / |s|.

    The denominator turns a difference of magnitudes into a distance, so that equal noise on the
    three raw axes gives equal noise on every residual.

    `noise_sd` takes out, to second order, what noise alone does to r and to its correlation with
    its own Jacobian on a curved surface: E[J r] = J σ² ½ (tr H − 4 nᵀHn)/|s| with
    H = Wᵀ(I − ûûᵀ)W/|u|; on a sphere this is the familiar σ²/F. Without it the error of the fit
    stops shrinking at some tens of thousands of samples.

    Parameters: raw (n, 3), bias (3,), matrix (3, 3), magnitude (n,) or scalar, noise_sd in raw
    units. Returns r (n,) in raw units and its Jacobian (n, 12).
    """
    d = (raw - bias).T.copy()  # component by component: long inner loops
    u = matrix @ d
    size = np.maximum(np.sqrt(_dot(u, u)), np.finfo(float).tiny)
    unit = u / size
    s = matrix.T @ unit
    gradient = np.sqrt(_dot(s, s))
    normal = s / gradient
    across = matrix @ normal
    across -= unit * _dot(unit, across)
    r = (size - magnitude) / gradient
    a = (unit - across * (r / size)) / gradient
    jacobian = np.empty((12, len(raw)))
    np.matmul(-matrix.T, a, out=jacobian[:3])
    tilt = unit * (r / gradient)
    entries = jacobian[3:].reshape(3, 3, -1)
    np.multiply(a[:, None], d[None], out=entries)
    entries -= tilt[:, None] * normal[None]
    if noise_sd:
        trace = np.sum(matrix**2) - gradient**2
        r = r - noise_sd**2 * 0.5 * (trace - 4.0 * _dot(across, across)) / (size * gradient)
    return r, jacobian.T


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def with_covariates(jacobian: Array, covariates: Array) -> Array:
    """The Jacobian by coefficients when each parameter is linear in covariates φ.

    parameter_j(i) = Σ_k φ_k(i) c_jk, so ∂r_i/∂c_jk = ∂r_i/∂parameter_j · φ_k(i).
    jacobian (n, m), covariates (n, k) → (n, m·k), coefficient k fastest.
    """
    return np.asarray((jacobian[:, :, None] * covariates[:, None, :]).reshape(len(jacobian), -1))


def correction_jacobian(raw: Array, bias: Array, matrix: Array) -> Array:
    """∂field/∂(twelve local numbers) of field = matrix @ (raw − bias), (n, 3, 12)."""
    d = np.atleast_2d(raw - bias)
    jacobian: NDArray[Any] = np.zeros((len(d), 3, 12))
    jacobian[:, :, :3] = -matrix
    for i in range(3):
        jacobian[:, i, 3 + 3 * i : 6 + 3 * i] = d
    return jacobian
