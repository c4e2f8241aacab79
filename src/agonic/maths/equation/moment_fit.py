"""The ellipsoid of readings that are kept as moments only, with a prior, robust against bad boxes.

The residual f = (|A(y − b)|² − 1)/2, about the distance over the radius, is a polynomial of second
degree in the reading, f = qᵀm(y) with m the ten monomials, so that the sum of its squares over any
number of readings is qᵀΨq with Ψ from their 35 moments; noise is taken out of Ψ as in the adjusted
fit (Kukush, Markovsky & Van Huffel 2004).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation import moments, quadric
from agonic.maths.equation.affine import correct, correction_jacobian, model_basis
from agonic.maths.equation.priors import make_prior
from agonic.maths.equation.starting_values import nearest_parameters
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.residuals import robust_scale

PLENTY = 25.0
"""Readings after which a box weighs no more: they were not made independently."""

OUTLIER = 4.0
"""Boxes whose mean residual is so many times the usual one do not count."""

ROUNDS = 4
"""Passes in which the noise and the boxes to use settle."""

MOST_STEPS = 15
"""Steps of a pass. Where little was seen the minimum lies at the end of a long bent valley that is
noise: with 60 steps the error of the bias is 4.4 standard errors at 1° to 5° of heading, with 15
it is 1.0 (rms over 16 simulated sessions)."""

FINEST = 1e-6
"""Less noise than this, over the radius, is not assumed."""

_BASIS = unpack_symmetric(np.eye(6))
"""The matrices of xx yy zz xy xz yz."""


class MomentEstimate(NamedTuple):
    """Bias (3,), symmetric matrix (3, 3) to magnitude one, their covariance (9, 9), the noise, the
    mean residual of each box `residuals` (k,) over the radius, and the weights (k,) they had."""

    bias: Array
    matrix: Array
    covariance: Array
    noise: float
    residuals: Array
    weights: Array
    condition: float
    iterations: int
    converged: bool


def estimate(
    sums: Array, soft_iron_sd: float | None = 0.1, start: tuple[Array, Array] | None = None
) -> MomentEstimate | None:
    """The fit to boxes with moments `sums` (k, 35) of points about centred, of size about one.

    `start` is a bias and matrix to begin from, the best sphere if there is none. Minimises
    Σ w qᵀΨq/σ² + |prior|², σ of the residual from what the fit leaves, and larger where boxes
    scatter more than their readings. `None` where no sphere can be laid through them.
    """
    params = _sphere(sums) if start is None else nearest_parameters(*start, model_basis("full"))
    if params is None:
        return None
    prior = make_prior("full", soft_iron_sd)
    share = np.minimum(1.0, PLENTY / sums[:, 0])
    weights, sd = share, 0.01
    for _ in range(ROUNDS):
        rows = _pieces(weights @ sums, sd / params[3:6].mean())
        solution = leastsq.solve(rows, params, scale=sd, prior=prior, max_iterations=MOST_STEPS)
        params = solution.params
        residuals, sd = _compute_residuals(sums, weights, params)
        used, weights = weights, share * _find_inliers(residuals, sd)
    return _assemble(sums, used, residuals, sd, solution, prior)


def compute_deviations(
    points: Array, bias: Array, matrix: Array, covariance: Array
) -> tuple[Array, Array]:
    """|A(y − b)| − 1 of points (n, 3), and the standard deviation √(jᵀCj) that the fit gives it."""
    field = correct(points, bias, matrix)
    size = np.linalg.norm(field, axis=1)
    jacobian = correction_jacobian(points, bias, matrix) @ model_basis("full")
    j = np.einsum("ni,nij->nj", field / np.maximum(size, 1e-9)[:, None], jacobian)
    variance = np.einsum("ni,ij,nj->n", j, covariance, j)
    return size - 1, np.sqrt(np.maximum(variance, 0.0))


def _pieces(total: Array, noise: float) -> leastsq.Pieces:
    """Ten rows whose squares add up to qᵀΨq, Ψ from the moments `total` less the noise's part."""
    psi = moments.compute_denoised_gram(total)
    values, vectors = np.linalg.eigh(psi[0] - noise**2 * psi[1] + noise**4 * psi[2])
    root = (vectors * np.sqrt(np.maximum(values, 0.0))).T

    def rows(params: Array) -> Iterator[tuple[Array, Array]]:
        q, slope = polynomial(params)
        yield root @ q, root @ slope

    return rows


def _sphere(sums: Array) -> Array | None:
    """Bias and gains of the best sphere, with every box counted alike."""
    psi = moments.compute_denoised_gram((np.minimum(1.0, PLENTY / sums[:, 0])) @ sums)
    try:
        bias, matrix = quadric.to_affine(quadric.fit_algebraic(psi[0], "sphere"))
    except ValueError:
        return None
    return nearest_parameters(bias, matrix, model_basis("full"))


def _matrix(params: Array) -> Array:
    return np.asarray(np.tensordot(params[3:], _BASIS, axes=1))


def polynomial(params: Array) -> tuple[Array, Array]:
    """q (10,) of the residual, and its derivative (10, 9) by bias and matrix."""
    bias, matrix = params[:3], _matrix(params)
    form = matrix @ matrix
    changes = np.concatenate(
        [np.zeros((3, 3, 3)), _BASIS @ matrix + matrix @ _BASIS]
    )  # of the form, by each parameter
    moved = np.concatenate([np.eye(3), np.zeros((6, 3))])  # of the bias
    linear = -2 * (changes @ bias + moved @ form)
    constant = changes @ bias @ bias + 2 * moved @ form @ bias
    q = np.concatenate([_quadratic(form), -2 * form @ bias, [bias @ form @ bias - 1.0]])
    slope = np.column_stack([_quadratic(changes), linear, constant]).T
    return q / 2, slope / 2


def _quadratic(form: Array) -> Array:
    """The coefficients of x² y² z² yz xz xy in yᵀ form y, (…, 6)."""
    pairs = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
    return np.stack([form[..., i, j] * (1 if i == j else 2) for i, j in pairs], axis=-1)


def _compute_residuals(sums: Array, weights: Array, params: Array) -> tuple[Array, float]:
    """The mean residual of each box (k,), and the standard deviation of one reading's residual."""
    q, _ = polynomial(params)
    placed = np.zeros(35)
    placed[moments.GRAM_INDEX[9]] = q
    total = weights @ sums
    freedom = total[0] * max(1 - 9 / max(int((weights > 0).sum()), 18), 0.5)
    square = float(q @ total[moments.GRAM_INDEX] @ q)
    return sums @ placed / sums[:, 0], float(np.sqrt(max(square / freedom, FINEST**2)))


def _find_inliers(residuals: Array, sd: float) -> Array:
    """1 for boxes that fit, 0 for those far out: metal came near while they were filled."""
    usual = max(robust_scale(residuals), sd / 2)
    return np.asarray((np.abs(residuals) < OUTLIER * usual).astype(np.float64))


def _assemble(
    sums: Array,
    weights: Array,
    residuals: Array,
    sd: float,
    solution: leastsq.Solution,
    prior: leastsq.Prior | None,
) -> MomentEstimate:
    """The result; boxes that scatter more than their readings do widen the covariance."""
    used_sums = weights * sums[:, 0]
    freedom = int((weights > 0).sum()) - 9
    scatter = float(used_sums @ residuals**2) / sd**2 / freedom if freedom > 9 else 1.0
    information = solution.information
    if prior is not None:
        jacobian = prior(solution.params)[1]
        information = information + jacobian.T @ jacobian
    return MomentEstimate(
        solution.params[:3],
        _matrix(solution.params),
        leastsq.inverse(information) * max(scatter, 1.0),
        sd / float(solution.params[3:6].mean()),
        residuals,
        weights,
        solution.condition,
        solution.iterations,
        solution.converged,
    )
