"""What residuals say of a fit by magnitude: its covariance, also where noise is unequal or has
memory, and how well it predicts readings that it has not seen."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation.channels import Problem, pieces
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.estimation.leastsq import inverse
from agonic.maths.estimation.noise.few_rows import FEW, scatter_of_few
from agonic.maths.estimation.noise.noise_with_memory import STRETCHES, Stretches, find_memory
from agonic.maths.estimation.noise.student import compute_widening

GEOMETRIES = slice(0, 3), slice(3, 4)
"""Slow errors stand in the axes of the sensor, or change the magnitude of the field."""

BLOCKS = 16
"""Blocks of time that are predicted one by one from the others."""

_BLOCK = 8192
_CHANCE = 1.5  # by so much more than chance does residuals' own scatter differ from an equal one
_WORST_CONDITION = 1e9
_LEAST_FREEDOM = 3.0
_LEAST_CURVATURE = 0.1  # as in `leastsq`


def compute_covariance(problem: Problem, estimate: Estimate, sums: Scatters) -> Array:
    """A⁻¹ B A⁻¹ of a fit by magnitude, B from how its gradient really scatters.

    The solver takes residuals for equally noisy and, but for one correlation length, independent.
    B = Σ w² z² J Jᵀ/(1 − h), h the leverage, needs neither; it counts as far as it differs from the
    former by more than chance. What noise with memory adds comes from the products of residuals.
    Few residuals tell their noise badly: B grows by Student's t.

    Source: H. White (1980), Econometrica 48, 817; MacKinnon & White (1985) for the leverage.
    """
    noise, solution = estimate.noise["magnitude"], estimate.solution
    n, m = len(problem.points), len(solution.params)
    known = problem.prior_information(solution.params)
    if noise.sd <= problem.rounding:  # residuals smaller than that are luck
        return inverse(solution.information + known)
    if n < 2 * m or solution.condition > _WORST_CONDITION:
        return solution.covariance
    length = noise.correlation
    information = sums.information.sum(axis=0)
    bread = inverse(information * (sums.curvature / length) + known)
    equal, own, chance = sums.equal, sums.own, sums.chance * length
    root = np.linalg.cholesky(inverse(information))
    apart = float(np.sum((root.T @ (own - equal) @ root) ** 2))
    alike = min(_CHANCE * chance / max(apart, 1e-300), 1.0)
    scatter = own + alike * (equal - own)
    memory = find_memory(sums.stretches, bread / length, GEOMETRIES)
    scatter = length * scatter if memory is None else memory.white * scatter + memory.scatter
    if n <= FEW and memory is None:
        scatter = max(scatter, _scatter_of_few(problem, estimate), key=lambda b: _size(bread, b))
    freedom = max(sums.rows / length - m, _LEAST_FREEDOM)
    scatter *= (compute_widening(freedom) / length) ** 2
    return np.asarray(bread @ (scatter + known) @ bread)


def _scatter_of_few(problem: Problem, estimate: Estimate) -> Array:
    """How the gradient scatters where rows are few, by all correlations that they leave likely."""
    _, residuals, jacobian = next(_blocks(problem, estimate, len(problem.points)))
    weights = np.sqrt(estimate.weights)
    return scatter_of_few(residuals * weights, jacobian * weights[:, None])


def _size(bread: Array, scatter: Array) -> float:
    """How uncertain a scatter of the gradient leaves all parameters together."""
    return float(np.trace(bread @ scatter))


def predict_unseen(problem: Problem, estimate: Estimate, sums: Scatters) -> Array:
    """The mean square of the residuals of each block of time by the fit without it, (16,).

    By one Newton step from the fit to all: without block b, with information A_b and gradient g_b,
    the parameters move by (A − A_b)⁻¹ g_b.
    """
    known = problem.prior_information(estimate.solution.params)
    noise = estimate.noise["magnitude"]
    without = sums.information.sum(axis=0) - sums.information + noise.correlation * known
    moved = np.einsum("bij,bj->bi", inverse(without), sums.gradient)
    square = sums.square + 2 * np.einsum("bi,bi->b", sums.gradient, moved)
    square += np.einsum("bi,bij,bj->b", moved, sums.information, moved)
    return np.asarray(square / np.maximum(sums.weight, 1.0) * noise.sd**2)


class Scatters(NamedTuple):
    """How the gradient scatters by equal and by own residuals, and by how much the two differ by
    chance; Σρ''/Σw of the loss; the stretches; how many rows count; and of each block of time
    Σ w J Jᵀ, Σ w z J, Σ w z² and Σ w.
    """

    equal: Array
    own: Array
    chance: float
    curvature: float
    stretches: Stretches
    rows: int
    information: Array
    gradient: Array
    square: Array
    weight: Array


def add_up(problem: Problem, estimate: Estimate) -> Scatters:
    """One pass over the readings, in units of the noise."""
    noise, solution = estimate.noise["magnitude"], estimate.solution
    n, m = len(problem.points), len(solution.params)
    root = np.linalg.cholesky(inverse(solution.information * noise.correlation))
    own, parts = np.zeros((m, m)), []
    information, gradient = np.zeros((BLOCKS, m, m)), np.zeros((BLOCKS, m))
    square, weight = np.zeros(BLOCKS), np.zeros(BLOCKS)
    total, fourth, lever, curvature = 0.0, 0.0, 0.0, 0.0
    each = -(-n // STRETCHES)
    for start, residuals, jacobian in _blocks(problem, estimate, each * max(_BLOCK // each, 1)):
        weights = estimate.weights[start : start + len(residuals)]
        turned = root.T @ jacobian.T  # a row a parameter, for long inner loops
        length = np.einsum("in,in->n", turned, turned)
        power = (weights * residuals) ** 2
        kept = np.maximum(1 - weights * length, 0.1)
        own += (jacobian.T * (power / kept)) @ jacobian
        for block, rows in _split(start, start + len(residuals), n):
            j, weighted = jacobian[rows], weights[rows] * residuals[rows]
            information[block] += (j.T * weights[rows]) @ j
            gradient[block] += weighted @ j
            square[block] += weighted @ residuals[rows]
            weight[block] += weights[rows].sum()
        curvature += float(noise.loss.curvature(residuals**2) @ (weights > 0))
        total += float(power.sum())
        fourth += float(power @ power)
        lever += float(length @ length)
        along = jacobian.T[:3]
        size = np.sqrt(np.einsum("in,in->n", along, along))
        directions = np.vstack([along / size, np.ones_like(size)]).T
        parts.append(Stretches.of(residuals, jacobian, weights, directions, each))
    count = int(np.count_nonzero(estimate.weights))
    whole = float(weight.sum())
    equal = information.sum(axis=0) * (total / whole * count / max(count - m, 1))
    spread = fourth / n - (total / n) ** 2
    stretches = Stretches(*(np.concatenate(of) for of in zip(*parts, strict=True)))
    bent = max(curvature / whole, _LEAST_CURVATURE)
    blocks = information, gradient, square, weight
    return Scatters(equal, own, spread * lever, bent, stretches, count, *blocks)


def _split(start: int, stop: int, n: int) -> Iterator[tuple[int, slice]]:
    """The blocks of time that rows from `start` to `stop` of n lie in, and their part of them."""
    for block in range(start * BLOCKS // n, (stop - 1) * BLOCKS // n + 1):
        first, last = -(-block * n // BLOCKS), -(-(block + 1) * n // BLOCKS)
        yield block, slice(max(first - start, 0), min(last, stop) - start)


def _blocks(problem: Problem, estimate: Estimate, rows: int) -> Iterator[tuple[int, Array, Array]]:
    """Rows in blocks: the number of the first, residuals and Jacobian in units of the noise."""
    sd = estimate.noise["magnitude"].sd
    for start in range(0, len(problem.points), rows):
        part = problem.subset(slice(start, start + rows))
        found = pieces(part, "magnitude", sd)(estimate.solution.params)
        residuals, jacobian = (np.concatenate(of) for of in zip(*found, strict=True))
        yield start, residuals / sd, jacobian / sd
