"""Maximum-likelihood ellipsoid from magnitudes: start, relax, refine.

Everything here works on points that are centred and scaled to about one, and on magnitudes scaled
to mean one; `fitting.ellipsoid` puts the units back.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.maths.equation import moments, quadric
from agonic.maths.equation.affine import magnitude_residual, model_basis, split
from agonic.maths.equation.coverage import find_cells
from agonic.maths.equation.gauge import mean_gain
from agonic.maths.equation.symmetric import pack_symmetric
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.least_median import fit_least_median_sphere
from agonic.maths.estimation.noise import Noise, estimate_noise, is_like_gaussian

_ROWS = 4096  # a block whose temporaries stay in the cache
_CROWD = 0.2  # of the readings
_ENOUGH = 3000  # readings for the search; the refinement uses all
_LITTLE = 0.01  # noise over the field that leaves no doubt about a fit
_DETERMINED = 0.05  # standard error over the field, or over the gain


Start = tuple[Array, Array, float]
"""Bias, matrix, and the standard deviation of soft iron in it from which the prior is relaxed."""


class Problem(NamedTuple):
    """Points (n, 3), magnitudes (1,) or (n,), the model, and the prior on soft iron (or None)."""

    points: Array
    magnitude: Array
    model: str
    soft_iron_sd: float | None

    def subset(self, rows: Index) -> Problem:
        """The same problem on some of the readings."""
        magnitude = self.magnitude if len(self.magnitude) == 1 else self.magnitude[rows]
        return self._replace(points=self.points[rows], magnitude=magnitude)


def pieces(problem: Problem, noise_sd: float = 0.0) -> leastsq.Pieces:
    """The magnitude residuals of a problem, block by block, for the solver."""
    basis = model_basis(problem.model)

    def blocks(params: Array) -> Iterator[tuple[Array, Array]]:
        bias, matrix = split(basis @ params)
        for start in range(0, len(problem.points), _ROWS):
            rows = slice(start, start + _ROWS)
            f = problem.magnitude if len(problem.magnitude) == 1 else problem.magnitude[rows]
            r, jacobian = magnitude_residual(problem.points[rows], bias, matrix, f, noise_sd)
            yield r, jacobian @ basis

    return blocks


def distances(raw: Array, bias: Array, matrix: Array, magnitude: Array) -> tuple[Array, Array]:
    """Distance of each reading from the ellipsoid and the unit normal there, (n,) and (n, 3)."""
    residuals, normals = np.empty(len(raw)), np.empty((len(raw), 3))
    for start in range(0, len(raw), _ROWS):
        rows = slice(start, start + _ROWS)
        f = magnitude if len(magnitude) == 1 else magnitude[rows]
        residuals[rows], jacobian = magnitude_residual(raw[rows], bias, matrix, f)
        np.negative(jacobian[:, :3], out=normals[rows])
    return residuals, normals


def soft_iron_prior(model: str, sd: float | None) -> leastsq.Prior | None:
    """Gaussian prior on what makes the matrix differ from a multiple of the identity.

    Residuals (W_ij/g − δ_ij)/sd over the six entries of the symmetric W, g = tr W / 3.
    """
    if sd is None or model == "sphere":
        return None
    count = {"diagonal": 3, "full": 6}[model]
    delta = np.array([1.0, 1, 1, 0, 0, 0])[:count]

    def prior(params: Array) -> tuple[Array, Array]:
        entries = params[3:]
        gain = entries[:3].mean()
        jacobian = np.zeros((count, len(params)))
        jacobian[:, 3:] = np.eye(count) / gain
        jacobian[:, 3:6] -= (entries / gain**2 / 3)[:, None]
        return (entries / gain - delta) / sd, jacobian / sd

    return prior


def soft_iron_pull(matrix: Array, covariance: Array, sd: float) -> Array:
    """By how many standard errors that prior would move a fit made without it, at most, (…).

    One step √(gᵀCg) along the gradient g = Jᵀρ of the prior's residuals ρ, as `soft_iron_prior`
    has them. Parameters: matrix (…, 3, 3) symmetric, covariance (…, 9, 9).
    """
    delta = np.array([1.0, 1, 1, 0, 0, 0])
    gain = np.asarray(mean_gain(matrix))[..., None]
    ratio = pack_symmetric(matrix) / gain
    residuals = (ratio - delta) / sd
    along = (residuals * ratio).sum(axis=-1, keepdims=True)
    gradient = (residuals - along * delta / 3) / (gain * sd)
    spread = covariance[..., 3:, 3:]
    square = np.einsum("...i,...ij,...j", gradient, spread, gradient)
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))


def parameters(bias: Array, matrix: Array, model: str) -> Array:
    """The parameters of a model nearest to a bias and matrix (least squares)."""
    local = np.concatenate([bias, matrix.ravel()])
    return np.asarray(np.linalg.lstsq(model_basis(model), local, rcond=None)[0])


class Estimate(NamedTuple):
    """The solution on the readings that were believed, and residuals and weights of all."""

    solution: leastsq.Solution
    noise: Noise
    residuals: Array
    weights: Array


def estimate(problem: Problem, *, robust: bool = True, seed: int = 0) -> Estimate:
    """The most probable bias and matrix, how sure they are, and the noise.

    The algebraic fit to a few thousand readings comes first. Where they all agree with its minimum,
    another one could hold for some of them only; otherwise a search finds where to start. Then all
    readings refine it, with Tukey's loss where any stands out. The refinement takes the noise's own
    effect on the curved surface out (`magnitude_residual`).
    """
    n = len(problem.points)
    few = problem
    if n > _ENOUGH:
        few = problem.subset(np.random.default_rng(seed).choice(n, _ENOUGH, replace=False))
    starts = _quadrics(few)
    for bias, matrix, _ in starts:
        found = _refine(few, parameters(bias, matrix, few.model), robust)
        if _agreed(found):
            return found if few is problem else _refine(problem, found.solution.params, robust)
    return _refine(problem, _search(few, starts, robust, seed), robust)


def corroborated(problem: Problem, solution: leastsq.Solution, weights: Array, sd: float) -> Mask:
    """Which readings other readings speak for, (n,).

    A stray reading can fall near the ellipsoid by chance, in a direction that was never visited;
    nothing there contradicts it, and it or a handful of them decide the result. So where some
    readings are strays (weight zero), none is believed in a cell of directions where strays are
    the majority. Readings of unusual leverage J C Jᵀ/σ² are a cell of their own, for just off the
    visited directions strays hide among honest readings; and none is believed that decides alone.
    """
    stray = weights == 0.0
    if not stray.any() or stray.all():
        return np.ones(len(weights), dtype=bool)
    bias, matrix = split(model_basis(problem.model) @ solution.params)
    cells = find_cells((problem.points - bias) @ matrix.T)
    leverage = np.concatenate(
        [
            np.einsum("ij,jk,ik->i", jacobian, solution.covariance / sd**2, jacobian)
            for _, jacobian in pieces(problem)(solution.params)
        ]
    )
    unusual = 25 * float(np.median(leverage[~stray]))
    if stray.mean() < _CROWD:  # more are no strays but another population
        cells[leverage > unusual] = 80
    readings, strays = np.bincount(cells, minlength=81), np.bincount(cells[stray], minlength=81)
    return np.asarray((2 * strays < readings)[cells] & (leverage < max(1 / 3, unusual)))


def _residuals(problem: Problem, params: Array) -> Array:
    return np.concatenate([r for r, _ in pieces(problem)(params)])


def _refine(problem: Problem, params: Array, robust: bool) -> Estimate:
    """The minimum on all believed readings, with noise level and correlation taken from them."""
    prior = soft_iron_prior(problem.model, problem.soft_iron_sd)
    noise = estimate_noise(_residuals(problem, params), robust, len(params))
    believed = np.ones(len(problem.points), dtype=bool)
    for _ in range(8):
        part = problem if believed.all() else problem.subset(np.flatnonzero(believed))
        solution = leastsq.solve(
            pieces(part, noise.sd),
            params,
            scale=noise.sd,
            loss=noise.loss,
            prior=prior,
            correlation=noise.correlation,
            tolerance=1e-2,
        )
        params, assumed = solution.params, noise
        residuals = solution.residuals if part is problem else _residuals(problem, params)
        weights = assumed.loss.weight((residuals / assumed.sd) ** 2)
        noise = estimate_noise(solution.residuals, robust, len(params))
        fewer = believed & corroborated(problem, solution, weights, assumed.sd)
        used, believed = believed, fewer if fewer.any() else believed
        if noise.settled(assumed) and np.array_equal(used, believed):
            break
    return Estimate(solution, noise, residuals, weights * used)


def _search(few: Problem, others: list[Start], robust: bool, seed: int) -> Array:
    """Parameters from which the refinement converges, found on a few thousand readings.

    From a start that outliers cannot reach, and from others, the prior on soft iron is relaxed step
    by step.
    """
    candidates = [(*_sphere(few, seed), 0.02), *others]
    starts = [_relax(few, bias, matrix, sd, robust) for bias, matrix, sd in candidates]
    found = [_refine(few, start, robust) for start in starts]
    return min(found, key=lambda e: leastsq.robust_scale(e.residuals)).solution.params


def _agreed(found: Estimate) -> bool:
    """Whether all readings lie as near to a well-determined surface as Gaussian noise lets them.

    What is left must be little beside the field, so that no second surface can hide in the noise.
    """
    return bool(
        found.weights.min() == 1.0
        and found.noise.sd < _LITTLE
        and is_like_gaussian(found.residuals, found.noise.sd, len(found.solution.params))
        and np.diag(found.solution.covariance).max() < _DETERMINED**2
    )


def _sphere(few: Problem, seed: int) -> tuple[Array, Array]:
    bias, gain = fit_least_median_sphere(few.points, few.magnitude, seed=seed)
    return bias, gain * np.eye(3)


def _quadrics(few: Problem) -> list[Start]:
    """The adjusted fit as a start, where the magnitude is constant and it is an ellipsoid."""
    if len(few.magnitude) > 1:
        return []
    psi = moments.compute_denoised_gram(moments.accumulate(few.points, np.zeros(3), 1.0))
    v, _ = quadric.fit_adjusted(psi, few.model)
    if not quadric.is_ellipsoid(v):
        return []
    bias, matrix = quadric.to_affine(v, float(few.magnitude[0]))
    return [(bias, matrix, 0.1)]


def _relax(few: Problem, bias: Array, matrix: Array, first_sd: float, robust: bool) -> Array:
    """From a start to the minimum with the prior on soft iron loosened step by step."""
    params = parameters(bias, matrix, few.model)
    loss = leastsq.cauchy() if robust else leastsq.squares()
    final = few.soft_iron_sd or np.inf
    steps = [sd for sd in (0.02, 0.05, 0.1) if first_sd <= sd < final]
    for sd in (*steps, few.soft_iron_sd, few.soft_iron_sd):
        scale = max(leastsq.robust_scale(_residuals(few, params), len(params)), 1e-9)
        params = leastsq.solve(
            pieces(few),
            params,
            scale=scale,
            loss=loss,
            prior=soft_iron_prior(few.model, sd),
            tolerance=0.1,
            max_iterations=25,
        ).params
    return params
