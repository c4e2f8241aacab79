"""field = W(φ)(raw − b(φ)) with coefficients linear in φ: powers of temperature, and its rate.

Each of the twelve local numbers (bias, then the matrix row by row) of a reading is C φ, and C
(12, q) = (layout @ coefficients) reshaped. The layout is what makes the matrix symmetric, or lets
it turn with temperature, and keeps the rate of change to the bias. The order of coefficients is
bias x y z, matrix xx yy zz xy xz yz (and yx zx zy), each with its powers; the three of the rate
come last.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation import polynomial
from agonic.maths.equation.affine import SYMMETRIC, model_basis, split


def build_covariates(
    x: Array, variance: Array | float, degree: int, rate: Array | None = None
) -> Array:
    """φ of readings or of means over temperatures that scatter by `variance` about x, (n, q)."""
    rows = polynomial.mean_powers(x, np.broadcast_to(variance, np.shape(x)), degree)
    return rows if rate is None else np.concatenate([rows, np.asarray(rate)[..., None]], axis=-1)


@lru_cache(maxsize=32)
def build_layout(degree: int, gauge: str = SYMMETRIC, rate: bool = False) -> Array:
    """The map from coefficients to the twelve local numbers times φ, (12·q, a)."""
    q, p = degree + 1 + rate, degree + 1
    basis = model_basis("full", gauge)
    parts = [np.kron(basis, np.eye(q)[:, :p])]
    if rate:
        parts.append(np.kron(basis[:, :3], np.eye(q)[:, p:]))
    layout = np.concatenate(parts, axis=1)
    layout.flags.writeable = False
    return layout


def evaluate_local(coefficients: Array, onto: Array, phi: Array) -> tuple[Array, Array]:
    """Bias (n, 3) and matrix (n, 3, 3) of each row of φ (n, q)."""
    c = (onto @ coefficients).reshape(12, -1)
    return split(phi @ c.T)


def chain_to_coefficients(jacobian: Array, onto: Array, phi: Array) -> Array:
    """A Jacobian (…, 12) with respect to the local numbers, by the coefficients (…, a).

    Parameters: φ (…, q), with axes as the Jacobian's or of length one. A coefficient multiplies one
    covariate, whatever entries of the matrix share it: so the local numbers are added up first, and
    each sum multiplied by its covariate after.
    """
    parts = onto.reshape(12, phi.shape[-1], -1)
    multiplied = np.abs(parts).max(axis=0).argmax(axis=0)
    by = jacobian.reshape(-1, 12) @ parts.sum(axis=1)
    return np.asarray(by.reshape(*jacobian.shape[:-1], -1) * phi[..., multiplied])


def size_residual(raw: Array, bias: Array, matrix: Array, wanted: Array) -> tuple[Array, Array]:
    """|W (raw − bias)| − wanted, (n,), bias and matrix for each row, and the Jacobian (n, 12).

    With u = W d, û = u/|u|:  ∂/∂bias = −Wᵀû,  ∂/∂W = û dᵀ.
    """
    d = raw - bias
    u = np.einsum("nij,nj->ni", matrix, d)
    size = np.maximum(np.linalg.norm(u, axis=1), np.finfo(float).tiny)
    unit = u / size[:, None]
    jacobian = np.empty((len(d), 12))
    jacobian[:, :3] = -np.einsum("nji,nj->ni", matrix, unit)
    jacobian[:, 3:] = (unit[:, :, None] * d[:, None, :]).reshape(len(d), 9)
    return size - wanted, jacobian


def reading_residual(
    raw: Array, bias: Array, matrix: Array, field: Array
) -> tuple[Array, Array, Array]:
    """raw − bias − W⁻¹ field, (n, 3): in the space of the readings, where their noise is.

    With v = W⁻¹ field:  ∂/∂bias = −1,  ∂/∂W_ij = W⁻¹e_i v_j,  ∂/∂field = −W⁻¹.

    Returns the residual, its Jacobian (n, 3, 12) by the local numbers, and W⁻¹ (n, 3, 3).
    """
    inverse = np.asarray(np.linalg.inv(matrix))
    v = np.einsum("nij,nj->ni", inverse, field)
    jacobian = np.empty((len(raw), 3, 4, 3))
    jacobian[:, :, 0] = -np.eye(3)
    np.multiply(inverse[:, :, :, None], v[:, None, None, :], out=jacobian[:, :, 1:])
    return raw - bias - v, jacobian.reshape(-1, 3, 12), inverse


def weak_prior(gauge: str, degree: int, sd: float) -> Array:
    """Weak prior that keeps what the stations leave open near a multiple of the identity.

    The gains less their mean, every other entry of the matrix, and every change of an entry with
    temperature are zero to `sd`; biases and the mean gain are free. Rows (r, a) in units of their
    standard deviation, for coefficients without those of the rate.
    """
    p = degree + 1
    count = model_basis("full", gauge).shape[1]
    rows = np.eye(count * p)[3 * p :]
    gains = [3 * p, 4 * p, 5 * p]
    rows[np.ix_([0, p, 2 * p], gains)] -= 1 / 3
    return np.asarray(rows / sd)
