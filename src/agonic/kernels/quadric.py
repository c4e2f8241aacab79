"""Ellipsoids as quadrics: Li & Griffiths' fit, adjusted least squares, and the way to bias, matrix.

A quadric is v = (a b c f g h p q r d) of
a x² + b y² + c z² + 2f yz + 2g xz + 2h xy + 2p x + 2q y + 2r z + d = 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from agonic.kernels import leastsq

Array = NDArray[np.float64]

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


def smallest(gram: Array, model: str = "full") -> Array:
    """The v that minimises the algebraic residual |Dᵀv| with |v| = 1: "linear", the textbook way.

    gram (10, 10) is the scatter of the ten monomials; centre and scale the data first.
    """
    basis = model_monomials(model)
    coefficients = eigh(basis.T @ gram @ basis)[1][:, 0]
    return np.asarray(basis @ coefficients / MULTIPLICITY)


def li_griffiths(gram: Array) -> Array:
    """The quadric of least algebraic residual under kJ − I² = 1, an ellipsoid for k = 4.

    With I = a+b+c, J = ab+bc+ac−f²−g²−h², the condition 4J − I² > 0 guarantees an ellipsoid but
    holds only while the shortest semi-axis is at least half the longest; for longer ones k is
    searched upwards for as long as the result stays an ellipsoid, and the least residual is kept.
    (Li & Griffiths, "Least squares ellipsoid specific fitting", GMP 2004.)
    """
    ks = (4.0, *np.geomspace(4.5, 256.0, 24))
    found = [v for k in ks if (v := _constrained(gram, k)) is not None and is_ellipsoid(v)]
    if not found:
        raise ValueError("no ellipsoid fits these readings")
    scatter = gram * np.outer(MULTIPLICITY, MULTIPLICITY)
    return min(found, key=lambda v: _tangential_residual(scatter, v))


def _constrained(gram: Array, k: float) -> Array | None:
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
    m, n, d = parts(v)
    return float(v @ scatter @ v) / (float(n @ np.linalg.solve(m, n)) - d) ** 2


def adjusted(
    psi: tuple[Array, Array, Array], model: str = "full", noise_variance: float | None = None
) -> tuple[Array, float]:
    """Adjusted least squares: the quadric that stays right however noisy the readings are.

    σ² is the smallest root of λ_min(Ψ(σ²)) = 0 and v the eigenvector there, with Ψ from
    `moments.denoised_gram`; a known `noise_variance` replaces the search. Returns v and σ².
    (Markovsky, Kukush & Van Huffel, "Consistent least squares fitting of ellipsoids",
    Numer. Math. 98, 2004.)
    """
    basis = model_monomials(model)
    reduced = [basis.T @ part @ basis for part in psi]

    if noise_variance is None:
        noise_variance = _smallest_root(reduced)
    coefficients = eigh(_at(reduced, noise_variance))[1][:, 0]
    return np.asarray(basis @ coefficients / MULTIPLICITY), noise_variance


def _at(psi: list[Array], variance: float) -> Array:
    return np.asarray(psi[0] - variance * psi[1] + variance**2 * psi[2])


def _smallest_root(psi: list[Array]) -> float:
    """The first zero of λ_min(Ψ(σ²)), by Newton's method; 0 for noiseless readings.

    λ_min is concave but for the small σ⁴ term, so after one step from 0 the iterates fall
    towards the root. Its derivative is vᵀ Ψ' v with v the eigenvector (Hellmann–Feynman).
    """
    variance = 0.0
    for _ in range(50):
        values, vectors = eigh(_at(psi, variance), subset_by_index=[0, 0])
        v = vectors[:, 0]
        slope = float(v @ (2 * variance * psi[2] - psi[1]) @ v)
        step = float(values[0]) / slope if slope < 0 else 0.0
        variance = max(variance - step, 0.0)
        if abs(step) <= 1e-12 * variance:
            break
    return variance


def parts(v: Array) -> tuple[Array, Array, float]:
    """M (3, 3), n (3,) and d of the quadric xᵀMx + 2nᵀx + d = 0."""
    a, b, c, f, g, h, p, q, r, d = v
    return np.array([[a, h, g], [h, b, f], [g, f, c]]), np.array([p, q, r]), float(d)


def is_ellipsoid(v: Array) -> bool:
    """All semi-axes real and finite."""
    m, n, d = parts(v)
    values = np.linalg.eigvalsh(m)
    if not (np.all(values > 0) or np.all(values < 0)):
        return False
    size = float(n @ np.linalg.solve(m, n)) - d
    return bool(size * values[0] > 0)


def to_affine(v: Array, magnitude: float = 1.0) -> tuple[Array, Array]:
    """Bias = −M⁻¹n and W = F · M^½ / √(nᵀM⁻¹n − d) of an ellipsoid (Li & Griffiths).

    Raises ValueError where the quadric is not an ellipsoid.
    """
    if not is_ellipsoid(v):
        raise ValueError("the quadric is not an ellipsoid")
    m, n, d = parts(v)
    bias = -np.linalg.solve(m, n)
    size = float(n @ np.linalg.solve(m, n)) - d
    values, vectors = np.linalg.eigh(m / size)
    return np.asarray(bias), np.asarray(magnitude * (vectors * np.sqrt(values)) @ vectors.T)


def algebraic_covariance(
    psi: Array, bias: Array, matrix: Array, basis: Array, noise_variance: float
) -> tuple[Array, float]:
    """Covariance of an algebraic fit's parameters and its condition, from denoised Ψ alone.

    The algebraic residual q = |W(x − b)|² − F² has ∂q/∂b = −2WᵀW d, ∂q/∂W = 2 u dᵀ, both
    polynomials of degree two, so Σ JᵀJ follows exactly from Ψ; its variance 4σ²|Wᵀu|² is replaced
    by the mean over the readings, which holds to the anisotropy of W squared.
    `basis` (12, m) is the model's map to the local numbers; psi (10, 10).
    """
    x = np.zeros((3, 10))  # coordinates as polynomials in the ten monomials
    x[[0, 1, 2], [6, 7, 8]] = 1.0
    one = np.eye(10)[9]
    d = x - bias[:, None] * one
    u = matrix @ d
    jacobian = [-2 * row for row in matrix.T @ u]
    jacobian += [2 * _product(u[i], d[j]) for i in range(3) for j in range(3)]
    reduced = basis.T @ np.array(jacobian)
    information = reduced @ psi @ reduced.T
    shape = matrix.T @ matrix
    moment = d @ psi @ d.T / psi[9, 9]
    variance = 4 * noise_variance * float(np.trace(shape @ shape @ moment))
    return leastsq.inverse(information) * variance, leastsq.condition(information)


def _product(a: Array, b: Array) -> Array:
    """The product of two polynomials of degree one, by the ten monomials."""
    outer = np.outer(a[6:], b[6:])
    outer = outer + outer.T
    return np.array([
        outer[0, 0] / 2, outer[1, 1] / 2, outer[2, 2] / 2, outer[1, 2], outer[0, 2], outer[0, 1],
        outer[0, 3], outer[1, 3], outer[2, 3], outer[3, 3] / 2,
    ])  # fmt: skip
