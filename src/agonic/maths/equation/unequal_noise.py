"""What noise that differs by axis does to a fit of curved surfaces, beyond noise equal on all axes.

The residual r of a reading and its Jacobian J hold the same noise, so Σ J r has a mean. For equal
noise the residuals take it out (`affine.magnitude_residual`). With variances v_j of the axes

    E[Σ J r] = ½ Σ_j v_j Σ ∂²(J r)/∂x_j²

and the minimum lies off by A⁻¹ E: on a vehicle that tilts by 15°, two standard errors of the bias
at 6000 readings where one axis has six times the noise of another.

Source: the second-order bias of errors-in-variables estimators (Wolter & Fuller 1982, Annals of
Statistics 10, 539).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.equation.affine import split
from agonic.maths.equation.channels import Problem, compute_residuals, field_of_terms, pieces
from agonic.maths.equation.maximum_likelihood import Estimate, find_attitude_shares
from agonic.maths.estimation.inference.model_averaging import average_over_term
from agonic.maths.estimation.leastsq import inverse

_UNEQUAL = 0.1  # probability that axes are not equally noisy, before the readings are seen
_STEP = 1e-2  # of the field, over which second derivatives are taken
_MOST = 20_000  # readings that tell them
_FEWEST = 100  # readings whose squares tell the noise of three axes
_NO_NOISE = 0.05  # of the field: more is misfit, of which its second derivatives tell nothing
_APART = np.array([[1.0, 1.0, 0.0], [1.0, -0.5, 0.75**0.5], [1.0, -0.5, -(0.75**0.5)]])
"""Variances of the axes from their mean and two numbers that say how they differ."""


class Corrected(NamedTuple):
    """An estimate, and what its covariance grows by for the uncertain noise of the axes, (m, m)."""

    estimate: Estimate
    growth: Array


def correct_for_unequal_noise(problem: Problem, estimate: Estimate) -> Corrected:
    """The estimate moved by what the axes' own noise does to it, as far as they are surely unlike.

    Parameters: the problem of the readings that were fitted.
    """
    n, solution = len(problem.points), estimate.solution
    as_it_was = Corrected(estimate, np.zeros_like(solution.covariance))
    if n < _FEWEST or not 0.0 < estimate.noise["magnitude"].sd < _NO_NOISE:
        return as_it_was
    variances, uncertainty = find_axis_variances(problem, estimate)
    if not uncertainty.any():
        return as_it_was
    rows = np.arange(0, n, -(-n // _MOST))
    by_axis = _find_pulls(problem.subset(rows), estimate, rows)
    known = inverse(solution.information + problem.prior_information(solution.params))
    moves = by_axis @ known * (n / len(rows))
    params = problem.move(solution.params, (variances - 1.0) @ moves)
    moved = estimate._replace(
        solution=solution._replace(params=params),
        residuals={c: compute_residuals(problem, c, params) for c in estimate.noise},
    )
    return Corrected(moved, moves.T @ uncertainty @ moves)


def find_axis_variances(problem: Problem, estimate: Estimate) -> tuple[Array, Array]:
    """Variance of the noise on each axis over that of the magnitude's residual, (3,), and its
    covariance (3, 3); ones and none where nothing speaks for a difference.

    The normal n of the surface says how much of each axis a residual holds: E[r²] = Σ_j n_j² v_j.
    That the axes are equal is one model and that they are not another; they are averaged.
    """
    noise, params = estimate.noise["magnitude"], estimate.solution.params
    used, raw = estimate.weights > 0, problem.points - field_of_terms(problem, params)
    residuals = estimate.residuals["magnitude"]
    if not used.all():
        raw, residuals = raw[used], residuals[used]
    bias, matrix = split(problem.basis @ params[: problem.basis.shape[1]])
    normals = (matrix.T @ matrix) @ (raw - bias).T  # axis by axis, for long inner loops
    squares = normals * normals
    squares /= np.maximum(squares.sum(axis=0), np.finfo(float).tiny)
    square, told = (residuals / noise.sd) ** 2, _APART.T @ squares
    covariance = inverse(told @ told.T)
    found = covariance @ (told @ square)
    left = float(np.mean((square - found @ told) ** 2)) * noise.correlation
    averaged = average_over_term(found, left * covariance, slice(1, 3), _UNEQUAL)
    if not averaged.params[1:].any():
        return np.ones(3), np.zeros((3, 3))
    level = float(averaged.params @ told.mean(axis=1))  # the residuals' own noise is known
    spread = _APART[:, 1:] @ averaged.covariance[1:, 1:] @ _APART[:, 1:].T
    return np.maximum(_APART @ averaged.params, 0.0) / level, spread / level**2


def _find_pulls(part: Problem, estimate: Estimate, rows: Index) -> Array:
    """E[Σ w J r/σ²] by the noise on each axis alone, (3, m)."""
    params, sd = estimate.solution.params, estimate.noise["magnitude"].sd
    shares, weights = find_attitude_shares(part, estimate.noise, params), estimate.weights[rows]

    steps = _STEP * np.concatenate([np.eye(3), -np.eye(3), np.zeros((1, 3))])
    points = (part.points + steps[:, None]).reshape(-1, 3)
    everywhere = part.subset(np.tile(np.arange(len(part.points)), len(steps)))
    moved, gradients = everywhere._replace(points=points), np.zeros((len(steps), len(params)))
    for channel, of in estimate.noise.items():
        found = zip(*pieces(moved, channel, 0.0, shares[channel])(params), strict=True)
        r, jacobian = (np.concatenate(side) for side in found)
        weighed = weights * r.reshape(len(steps), 1, -1)
        sums = weighed @ jacobian.reshape(len(steps), -1, len(params))
        gradients += sums[:, 0] / of.sd**2 / of.correlation
    ahead, back, plain = gradients[:3], gradients[3:6], gradients[6]
    return np.asarray(0.5 * sd**2 * (ahead + back - 2.0 * plain) / _STEP**2)
