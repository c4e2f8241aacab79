"""Ellipsoids as quadrics: Li & Griffiths' fit, adjusted least squares, and the way to bias, matrix.

A quadric is v = (a b c f g h p q r d) of
a x² + b y² + c z² + 2f yz + 2g xz + 2h xy + 2p x + 2q y + 2r z + d = 0.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Mask
from agonic.maths.estimation import leastsq

MULTIPLICITY = np.array([1.0, 1, 1, 2, 2, 2, 2, 2, 2, 1])
"""What each element of v is multiplied by in the polynomial."""


def model_monomials(model: str) -> Array:
    """The map (10, m) from a model's polynomial coefficients to the ten monomials."""
    if model == "full":
        return np.eye(10)
    quadratic = np.zeros((10, 3))
    quadratic[:3] = np.eye(3)
    if model == "sphere":
        quadratic = quadratic.sum(axis=1, keepdims=True)
    return np.hstack([quadratic, np.eye(10)[:, 6:]])


def fit_algebraic(gram: Array, model: str = "full") -> Array:
    """The v that minimises the algebraic residual |Dᵀv| with |v| = 1: "linear", the textbook way.

    gram (…, 10, 10) is the scatter of the ten monomials; centre and scale the data first.
    """
    basis = model_monomials(model)
    coefficients = np.linalg.eigh(basis.T @ gram @ basis)[1][..., 0]
    return np.asarray(coefficients @ basis.T / MULTIPLICITY)


def fit_li_griffiths(gram: Array) -> Array:
    """The quadric of least algebraic residual under kJ − I² = 1, an ellipsoid for k = 4.

    With I = a+b+c, J = ab+bc+ac−f²−g²−h², the condition 4J − I² > 0 guarantees an ellipsoid but
    holds only while the shortest semi-axis is at least half the longest; for longer ones k is
    searched upwards for as long as the result stays an ellipsoid, and the least residual is kept.
    (Li & Griffiths, "Least squares ellipsoid specific fitting", GMP 2004.)
    """
    ks = (4.0, *np.geomspace(4.5, 256.0, 24))
    found = [v for k in ks if (v := _fit_constrained(gram, k)) is not None and is_ellipsoid(v)]
    if not found:
        raise ValueError("no ellipsoid fits these readings")
    scatter = gram * np.outer(MULTIPLICITY, MULTIPLICITY)
    return min(found, key=lambda v: _tangential_residual(scatter, v))


def _fit_constrained(gram: Array, k: float) -> Array | None:
    """The minimiser for one k: C₁⁻¹(S₁₁ − S₁₂S₂₂⁻¹S₁₂ᵀ)v₁ = λv₁, the one positive eigenvalue.

    It is told by v₁ᵀC₁v₁ > 0, for exact readings have λ = 0 up to rounding.
    """
    s = gram * np.outer(MULTIPLICITY, MULTIPLICITY)
    constraint = np.diag([-1.0, -1, -1, -k, -k, -k])
    constraint[:3, :3] += (k / 2.0) * (1.0 - np.eye(3)) - (1.0 - np.eye(3))
    s22_inverse_s21 = np.linalg.solve(s[6:, 6:], s[6:, :6])
    reduced = s[:6, :6] - s[:6, 6:] @ s22_inverse_s21
    vectors = np.linalg.eig(np.linalg.solve(constraint, reduced))[1].real
    inside = np.einsum("ij,ik,kj->j", vectors, constraint, vectors)
    best = int(np.argmax(inside))
    if inside[best] <= 0:
        return None
    v1 = vectors[:, best]
    return np.concatenate([v1, -s22_inverse_s21 @ v1])


def _tangential_residual(scatter: Array, v: Array) -> float:
    """Algebraic residual in units that do not depend on the scaling of v: over |nᵀM⁻¹n − d|."""
    m, n, d = split_quadric(v)
    return float(v @ scatter @ v / (n @ np.linalg.solve(m, n) - d) ** 2)


def fit_adjusted(
    psi: tuple[Array, Array, Array],
    model: str = "full",
    noise_variance: float | Array | None = None,
) -> tuple[Array, Array]:
    """Adjusted least squares: the quadric that stays right however noisy the readings are.

    σ² is the smallest root of λ_min(Ψ(σ²)) = 0 and v the eigenvector there, with Ψ (…, 10, 10) from
    `moments.compute_denoised_gram`; a known `noise_variance` replaces the search. Returns v
    (…, 10) and σ² (…).
    (Markovsky, Kukush & Van Huffel, "Consistent least squares fitting of ellipsoids",
    Numer. Math. 98, 2004.)
    """
    basis = model_monomials(model)
    first, second, third = (basis.T @ part @ basis for part in psi)
    reduced = (first, second, third)
    variance = (
        _smallest_root(reduced) if noise_variance is None else np.asarray(noise_variance, float)
    )
    coefficients = np.linalg.eigh(_at(reduced, variance))[1][..., 0]
    return np.asarray(coefficients @ basis.T / MULTIPLICITY), variance


def _at(psi: tuple[Array, Array, Array], variance: Array) -> Array:
    at = variance[..., None, None]
    return np.asarray(psi[0] - at * psi[1] + at**2 * psi[2])


def _smallest_root(psi: tuple[Array, Array, Array]) -> Array:
    """The first zero of λ_min(Ψ(σ²)), by Newton's method; 0 for noiseless readings.

    λ_min is concave but for the small σ⁴ term, so after one step from 0 the iterates fall
    towards the root. Its derivative is vᵀ Ψ' v with v the eigenvector (Hellmann–Feynman).
    """
    shape, size = psi[0].shape[:-2], psi[0].shape[-1]
    parts = [part.reshape(-1, size, size) for part in psi]
    variance = np.zeros(len(parts[0]))
    open_ = np.arange(len(variance))
    for _ in range(50):
        first, second, third = (part[open_] for part in parts)
        values, vectors = np.linalg.eigh(_at((first, second, third), variance[open_]))
        v = vectors[..., 0]
        change = 2 * variance[open_, None, None] * third - second
        slope = np.einsum("ni,nij,nj->n", v, change, v)
        step = np.where(slope < 0, values[:, 0] / np.where(slope < 0, slope, 1.0), 0.0)
        variance[open_] = np.maximum(variance[open_] - step, 0.0)
        open_ = open_[np.abs(step) > 1e-9 * variance[open_]]
        if not len(open_):
            break
    return variance.reshape(shape)


def split_quadric(v: Array) -> tuple[Array, Array, Array]:
    """M (…, 3, 3), n (…, 3) and d (…) of the quadric xᵀMx + 2nᵀx + d = 0."""
    return v[..., [[0, 5, 4], [5, 1, 3], [4, 3, 2]]], v[..., 6:9], v[..., 9]


def is_ellipsoid(v: Array) -> Mask:
    """Whether all semi-axes are real and finite, (…)."""
    m, n, d = split_quadric(v)
    values = np.linalg.eigvalsh(m)
    definite = np.asarray((values > 0).all(axis=-1) | (values < 0).all(axis=-1))
    safe = np.where(definite[..., None, None], m, np.eye(3))
    size = np.einsum("...i,...i->...", n, _solve(safe, n)) - d
    return np.asarray(definite & (size * values[..., 0] > 0))


def _solve(m: Array, n: Array) -> Array:
    return np.asarray(np.linalg.solve(m, n[..., None])[..., 0])


def to_affine(v: Array, magnitude: float = 1.0) -> tuple[Array, Array]:
    """Bias = −M⁻¹n and W = F · M^½ / √(nᵀM⁻¹n − d) of ellipsoids (…, 10) (Li & Griffiths).

    Raises ValueError where a quadric is not an ellipsoid.
    """
    if not is_ellipsoid(v).all():
        raise ValueError("the quadric is not an ellipsoid")
    m, n, d = split_quadric(v)
    bias = -_solve(m, n)
    size = -np.einsum("...i,...i->...", n, bias) - d
    values, vectors = np.linalg.eigh(m / size[..., None, None])
    root = (vectors * np.sqrt(values)[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return bias, np.asarray(magnitude * root)


def algebraic_covariance(
    psi: Array, bias: Array, matrix: Array, basis: Array, noise_variance: float | Array
) -> tuple[Array, Array]:
    """Covariance of an algebraic fit's parameters and its condition, from denoised Ψ alone.

    The algebraic residual q = |W(x − b)|² − F² has ∂q/∂b = −2WᵀW d, ∂q/∂W = 2 u dᵀ, both
    polynomials of degree two, so Σ JᵀJ follows exactly from Ψ; its variance 4σ²|Wᵀu|² is replaced
    by the mean over the readings, which holds to the anisotropy of W squared.
    `basis` (12, m) is the model's map to the local numbers; psi (…, 10, 10).
    """
    x = np.zeros((3, 10))  # coordinates as polynomials in the ten monomials
    x[[0, 1, 2], [6, 7, 8]] = 1.0
    one = np.eye(10)[9]
    d = x - bias[..., None] * one
    u = matrix @ d
    by_bias = -2 * np.swapaxes(matrix, -1, -2) @ u
    by_matrix = 2 * _product(u[..., :, None, :], d[..., None, :, :])
    by_matrix = by_matrix.reshape(*by_matrix.shape[:-3], 9, 10)
    reduced = basis.T @ np.concatenate([by_bias, by_matrix], axis=-2)
    information = reduced @ psi @ np.swapaxes(reduced, -1, -2)
    shape = np.swapaxes(matrix, -1, -2) @ matrix
    moment = d @ psi @ np.swapaxes(d, -1, -2) / psi[..., 9:, 9:]
    stretch = np.trace(shape @ shape @ moment, axis1=-2, axis2=-1)
    variance = np.asarray(4 * noise_variance * stretch)
    spread = leastsq.inverse(information) * variance[..., None, None]
    return np.asarray(spread), leastsq.condition(information)


def _product(a: Array, b: Array) -> Array:
    """The product of two polynomials of degree one, by the ten monomials, (…, 10)."""
    outer = a[..., 6:, None] * b[..., None, 6:]
    outer = outer + np.swapaxes(outer, -1, -2)
    squares = np.einsum("...ii->...i", outer) / 2
    rows, columns = [1, 0, 0, 0, 1, 2], [2, 2, 1, 3, 3, 3]
    return np.concatenate([squares[..., :3], outer[..., rows, columns], squares[..., 3:]], axis=-1)
