"""W(T) and b(T) where the field's components are known at every reading, as in a coil.

The residual is raw − b(T) − W(T)⁻¹ field, in the space of the readings where their noise is, so
noise does not pull the gains towards zero. Points are scaled to about one, as are fields.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation import temperature_model
from agonic.maths.equation.affine import FREE
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.noise_with_memory import STRETCHES, Stretches, find_memory
from agonic.maths.estimation.noise.residuals import Noise, estimate_noise, robust_scale

BLOCKS = 10
"""Blocks of readings, in their order, each of which a fit is tried on that has not seen it."""
_ROWS = 4096  # rows whose temporaries stay in the cache
_DOUBTED = 0.2  # weight of an outlier
_GROSS = 6.0  # standard deviations: what no fit foretells says nothing of either


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

    def select(self, rows: slice) -> KnownFieldProblem:
        """Some of the rows."""
        return self._replace(points=self.points[rows], field=self.field[rows], phi=self.phi[rows])


class KnownFieldEstimate(NamedTuple):
    """The solution, the noise of a reading on one axis, residuals (n, 3) and weights (n,);
    `unseen` (n, 3) are the residuals by the fit without the block in which a reading lies;
    `prior` (a, a) is the information of the prior."""

    solution: leastsq.Solution
    noise: Noise
    residuals: Array
    weights: Array
    unseen: Array
    prior: Array


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
            by = temperature_model.chain_to_coefficients(jacobian, onto, phi[:, None])
            yield r.ravel(), by.reshape(r.size, -1)

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


def leave(problem: KnownFieldProblem, params: Array) -> Array:
    """The residuals (n, 3)."""
    return np.concatenate([r for r, _ in make_pieces(problem)(params)]).reshape(-1, 3)


def measure_clustering(weights: Array) -> float:
    """The share of the readings that were taken for outliers that stand beside another such."""
    out = weights < _DOUBTED
    beside = np.concatenate([[False], out[:-1]]) | np.concatenate([out[1:], [False]])
    return float(beside[out].mean()) if out.any() else 0.0


def compare_unseen(one: KnownFieldEstimate, other: KnownFieldEstimate) -> float:
    """The rms of what an estimate leaves unseen; no reading counts for more than what is gross to
    the other."""
    limit = _GROSS * robust_scale(other.unseen.ravel())
    return float(np.sqrt(np.mean(np.minimum(np.abs(one.unseen), limit) ** 2)))


def summarise(
    problem: KnownFieldProblem, params: Array, covariance: Array, noise: Noise, weights: Array
) -> KnownFieldEstimate:
    """An estimate with its residuals, and its covariance as noise with memory makes it.

    Parameters: coefficients (a,), their covariance (a, a) by white noise and prior, weights (n,) of
    the readings.
    """
    of_axes = np.repeat(weights, 3).reshape(-1, 3)
    left = leave(problem, params)
    r = left.ravel()
    information = sum_up(problem, params, of_axes)[0] / noise.sd**2
    prior = _find_prior(covariance, information / noise.correlation)
    covariance = _allow_for_memory(problem, params, covariance, prior, noise.sd, of_axes.ravel())
    solution = leastsq.Solution(
        params,
        covariance,
        r,
        float(r @ r) / noise.sd**2 / 2,
        information,
        float(leastsq.condition(information)),
        1,
        True,
    )
    unseen = _predict_unseen(problem, params, of_axes, prior * noise.sd**2 * noise.correlation)
    return KnownFieldEstimate(solution, noise, left, weights, unseen, prior)


def _find_prior(covariance: Array, information: Array) -> Array:
    """What is known beyond the readings' own information, (a, a), positive."""
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    outer = np.outer(size, size)
    values, axes = np.linalg.eigh(leastsq.inverse(covariance) * outer - information * outer)
    return np.asarray((axes * np.maximum(values, 0.0)) @ axes.T / outer)


def _allow_for_memory(
    problem: KnownFieldProblem,
    params: Array,
    covariance: Array,
    prior: Array,
    sd: float,
    weights: Array,
) -> Array:
    """The covariance that noise with memory makes, where residuals show some.

    One correlation length is that of all coefficients; but those of a temperature that changes
    slowly feel slow errors, and those of a field that switches do not.
    """
    each, done, parts = -(-len(problem.points) // STRETCHES), 0, []
    information = np.zeros_like(covariance)
    rows = max(_ROWS // each, 1) * each
    for start in range(0, len(problem.points), rows):
        block = problem.select(slice(start, start + rows))
        r, jacobian = (
            np.concatenate(part) / sd for part in zip(*make_pieces(block)(params), strict=True)
        )
        own = weights[done : done + len(r)]
        done += len(r)
        information += (jacobian.T * own) @ jacobian
        axes = np.tile(np.eye(3), (len(r) // 3, 1))
        parts.append(Stretches.of(r, jacobian, own, axes, 3 * each))
    response = leastsq.inverse(information + prior)
    stretches = Stretches(*(np.concatenate(of) for of in zip(*parts, strict=True)))
    memory = find_memory(stretches, response, (slice(0, 3),))
    if memory is None:
        return covariance
    scatter = memory.white * information + memory.scatter + prior
    return np.asarray(response @ scatter @ response)


def list_blocks(n: int) -> list[slice]:
    """The rows of each of `BLOCKS` blocks of n readings."""
    edges = np.linspace(0, n, BLOCKS + 1).astype(int)
    return [slice(a, b) for a, b in pairwise(edges.tolist())]


def _predict_unseen(
    problem: KnownFieldProblem, params: Array, weights: Array, prior: Array
) -> Array:
    """The residuals (n, 3) of each of `BLOCKS` blocks by the fit of the others.

    With A = Σ w JᵀJ + P, P the prior, and g = Σ w Jᵀr, the fit without block b lies (A − A_b)⁻¹ g_b
    from that of the whole: a Gauss–Newton step, exact where residuals are linear.
    """
    blocks = list_blocks(len(problem.points))
    sums = [sum_up(problem.select(rows), params, weights[rows])[:2] for rows in blocks]
    whole = prior + np.sum([information for information, _ in sums], axis=0)
    unseen = np.empty((len(problem.points), 3))
    for rows, (information, gradient) in zip(blocks, sums, strict=True):
        step = leastsq.inverse(whole - information) @ gradient
        pieces = make_pieces(problem.select(rows))(params)
        unseen[rows] = np.concatenate([r + jacobian @ step for r, jacobian in pieces]).reshape(
            -1, 3
        )
    return unseen


def sum_up(problem: KnownFieldProblem, params: Array, weights: Array) -> tuple[Array, Array, float]:
    """Information, gradient, and squares of the residuals of some readings."""
    a, done, square = len(params), 0, 0.0
    information, gradient, flat = np.zeros((a, a)), np.zeros(a), weights.ravel()
    for r, jacobian in make_pieces(problem)(params):
        own = flat[done : done + len(r)]
        weighted = jacobian * own[:, None]
        information += weighted.T @ jacobian
        gradient += r @ weighted
        square += float(own @ r**2)
        done += len(r)
    return information, gradient, square


def estimate_noise_of(residuals: Array, robust: bool, parameters: int) -> Noise:
    """The noise of residuals, three to a row: each axis in time order, one after the other."""
    return estimate_noise(residuals.reshape(-1, 3).T.ravel(), robust, parameters)
