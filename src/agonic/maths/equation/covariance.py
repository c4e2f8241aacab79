"""The covariance of a fit by magnitude from its own residuals: unequal noise, noise with memory."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation.channels import Problem, pieces
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.estimation.leastsq import inverse
from agonic.maths.estimation.noise_with_memory import STRETCHES, Stretches, find_memory
from agonic.maths.estimation.student import compute_widening

GEOMETRIES = slice(0, 3), slice(3, 4)
"""Slow errors stand in the axes of the sensor, or change the magnitude of the field."""

_BLOCK = 4096
_CHANCE = 1.5  # by so much more than chance does residuals' own scatter differ from an equal one
_WORST_CONDITION = 1e9
_LEAST_FREEDOM = 3.0
_LEAST_CURVATURE = 0.1  # as in `leastsq`


def compute_covariance(problem: Problem, estimate: Estimate) -> Array:
    """A⁻¹ B A⁻¹ of a fit by magnitude, B from how its gradient really scatters.

    The solver takes residuals for equally noisy and, but for one correlation length, independent.
    B = Σ w² z² J Jᵀ/(1 − h), h the leverage, needs neither; it counts as far as it differs from the
    former by more than chance. What noise with memory adds comes from the products of residuals.
    Few residuals tell their noise badly: B grows by Student's t.

    Source: H. White (1980), Econometrica 48, 817; MacKinnon & White (1985) for the leverage.
    """
    noise, solution = estimate.noise["magnitude"], estimate.solution
    n, m = len(problem.points), len(solution.params)
    prior = problem.prior(problem.soft_iron_sd)
    known = np.zeros((m, m))
    if prior is not None:
        jacobian = prior(solution.params)[1]
        known = jacobian.T @ jacobian
    if noise.sd <= problem.rounding:  # residuals smaller than that are luck
        return inverse(solution.information + known)
    if n < 2 * m or solution.condition > _WORST_CONDITION:
        return solution.covariance
    length = noise.correlation
    sums = _add_up(problem, estimate)
    bread = inverse(sums.information * (sums.curvature / length) + known)
    equal, own, chance = sums.equal, sums.own, sums.chance * length
    root = np.linalg.cholesky(inverse(sums.information))
    apart = float(np.sum((root.T @ (own - equal) @ root) ** 2))
    alike = min(_CHANCE * chance / max(apart, 1e-300), 1.0)
    scatter = own + alike * (equal - own)
    memory = find_memory(sums.stretches, bread / length, GEOMETRIES)
    scatter = length * scatter if memory is None else memory.white * scatter + memory.scatter
    freedom = max(sums.rows / length - m, _LEAST_FREEDOM)
    scatter *= (compute_widening(freedom) / length) ** 2
    return np.asarray(bread @ (scatter + known) @ bread)


class _Scatters(NamedTuple):
    """How the gradient scatters by equal and by own residuals, and by how much the two differ by
    chance; Σ w J Jᵀ and Σρ''/Σw of the loss; the stretches; how many rows count."""

    equal: Array
    own: Array
    information: Array
    curvature: float
    chance: float
    stretches: Stretches
    rows: int


def _add_up(problem: Problem, estimate: Estimate) -> _Scatters:
    """One pass over the readings."""
    noise, solution = estimate.noise["magnitude"], estimate.solution
    n, m = len(problem.points), len(solution.params)
    root = np.linalg.cholesky(inverse(solution.information * noise.correlation))
    own, information, parts = np.zeros((m, m)), np.zeros((m, m)), []
    weight, square, fourth, lever, curvature = 0.0, 0.0, 0.0, 0.0, 0.0
    each = -(-n // STRETCHES)
    for start, residuals, jacobian in _blocks(problem, estimate, each * max(_BLOCK // each, 1)):
        weights = estimate.weights[start : start + len(residuals)]
        length = np.sum((jacobian @ root) ** 2, axis=1)
        power = (weights * residuals) ** 2
        kept = np.maximum(1 - weights * length, 0.1)
        own += (jacobian.T * (power / kept)) @ jacobian
        information += (jacobian.T * weights) @ jacobian
        weight += float(weights.sum())
        curvature += float(noise.loss.curvature(residuals**2) @ (weights > 0))
        square += float(power.sum())
        fourth += float(power @ power)
        lever += float(length @ length)
        size = np.sqrt(np.sum(jacobian[:, :3] ** 2, axis=1, keepdims=True))
        directions = np.hstack([jacobian[:, :3] / size, np.ones_like(size)])
        stretch = np.arange(len(residuals)) // each
        parts.append(Stretches.of(residuals, jacobian, weights, directions, stretch))
    count = int(np.count_nonzero(estimate.weights))
    equal = information * (square / weight * count / max(count - m, 1))
    spread = fourth / n - (square / n) ** 2
    stretches = Stretches(*(np.concatenate(of) for of in zip(*parts, strict=True)))
    bent = max(curvature / weight, _LEAST_CURVATURE)
    return _Scatters(equal, own, information, bent, spread * lever, stretches, count)


def _blocks(problem: Problem, estimate: Estimate, rows: int) -> Iterator[tuple[int, Array, Array]]:
    """Rows in blocks: the number of the first, residuals and Jacobian in units of the noise."""
    sd = estimate.noise["magnitude"].sd
    for start in range(0, len(problem.points), rows):
        part = problem.subset(slice(start, start + rows))
        found = pieces(part, "magnitude", sd)(estimate.solution.params)
        residuals, jacobian = (np.concatenate(of) for of in zip(*found, strict=True))
        yield start, residuals / sd, jacobian / sd
