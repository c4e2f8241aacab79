"""W(T) and b(T) where the field's components are known at every reading, as in a coil.

The residual is raw − b(T) − W(T)⁻¹ field, in the space of the readings where their noise is, so
noise does not pull the gains towards zero. Points are scaled to about one, as are fields.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation import temperature_model
from agonic.maths.equation.affine import FREE
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise import Noise, estimate_noise

_ROWS = 4096  # a block whose temporaries stay in the cache


class KnownFieldProblem(NamedTuple):
    """Points (n, 3), fields (n, 3), covariates φ (n, q), and what they multiply."""

    points: Array
    field: Array
    phi: Array
    degree: int
    rate: bool = False

    @property
    def layout(self) -> Array:
        """From the coefficients to the local numbers: all nine entries of the matrix are free."""
        return temperature_model.build_layout(self.degree, FREE, self.rate)


class KnownFieldEstimate(NamedTuple):
    """The solution, the noise of a reading on one axis, residuals (n, 3) and weights (n,)."""

    solution: leastsq.Solution
    noise: Noise
    residuals: Array
    weights: Array


def make_pieces(problem: KnownFieldProblem) -> leastsq.Pieces:
    """Residuals of the readings block by block, three to a row."""
    onto = problem.layout

    def blocks(params: Array) -> Iterator[tuple[Array, Array]]:
        for start in range(0, len(problem.points), _ROWS):
            rows = slice(start, start + _ROWS)
            phi = problem.phi[rows]
            bias, matrix = temperature_model.evaluate_local(params, onto, phi)
            r, jacobian, _ = temperature_model.reading_residual(
                problem.points[rows], bias, matrix, problem.field[rows]
            )
            by = temperature_model.chain_to_coefficients(
                jacobian.reshape(-1, 12), onto, np.repeat(phi, 3, axis=0)
            )
            yield r.ravel(), by

    return blocks


def find_start(problem: KnownFieldProblem) -> Array:
    """Coefficients that do not change with temperature, by linear least squares."""
    rows = np.hstack([problem.field, np.ones((len(problem.field), 1))])
    solution = np.linalg.lstsq(rows, problem.points, rcond=None)[0]
    response = solution[:3].T
    matrix = np.linalg.inv(response)
    q = problem.phi.shape[1]
    local = np.zeros((12, q))
    local[:, 0] = np.concatenate([solution[3], matrix.ravel()])
    return np.asarray(np.linalg.lstsq(problem.layout, local.ravel(), rcond=None)[0])


def estimate_known_field(problem: KnownFieldProblem, *, robust: bool = True) -> KnownFieldEstimate:
    """The most probable coefficients, and the noise, taken from the residuals."""
    params = find_start(problem)
    first = leastsq.solve(
        make_pieces(problem),
        params,
        scale=1.0,
        loss=leastsq.squares(),
        tolerance=1e-6,
        max_iterations=5,
    )
    params, residuals = first.params, first.residuals
    for _ in range(10):
        noise = _estimate_noise(residuals, robust, len(params))
        solution = leastsq.solve(
            make_pieces(problem),
            params,
            scale=noise.sd,
            loss=noise.loss,
            correlation=noise.correlation,
            tolerance=1e-2,
        )
        params, residuals = solution.params, solution.residuals
        if _estimate_noise(residuals, robust, len(params)).settled(noise):
            break
    weights = noise.loss.weight((residuals / noise.sd) ** 2).reshape(-1, 3).min(axis=1)
    return KnownFieldEstimate(solution, noise, residuals.reshape(-1, 3), weights)


def _estimate_noise(residuals: Array, robust: bool, parameters: int) -> Noise:
    """The noise of residuals, three to a row: each axis in time order, one after the other."""
    return estimate_noise(residuals.reshape(-1, 3).T.ravel(), robust, parameters)
