"""The most probable bias and matrix of the readings of an opening, all taken together."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from agonic.arrays import Array
from agonic.calibration.tracking import TrackerParams, TrackerState
from agonic.maths.equation.affine import SYMMETRIC, magnitude_residual, model_basis, split
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.filters.states import FilterState
from agonic.maths.estimation.loss import cauchy, tukey
from agonic.maths.estimation.noise.residuals import robust_scale
from agonic.maths.estimation.robust.least_median import fit_least_median_sphere

_CERTAIN = 0.1  # of the field: a prior on the bias below this needs no search
_SAME = 1.0  # standard error: ways that come so near each other end in one place
_ROUGH = 0.1  # standard errors to which a solution is found that only serves the next


def find_most_probable(
    state: TrackerState, prior: FilterState, rows: Array, params: TrackerParams
) -> tuple[Array, float, Array]:
    """The most probable state (10,) of the rows as if nothing moved, the noise, and how far from
    it the bias (3,) is in states nearly as probable: by a chance of √n, for another direction sees
    another component of the noise, whose sum of squares over n readings differs by so much."""
    m = len(prior.diagonal) - 1
    gaussian = GaussianPrior(prior)
    found: list[tuple[float, Array]] = []
    for first in _starts(state, prior, rows):
        scale = max(_scale(state, params, rows, first, m), robust_scale(residuals_at(rows, first)))
        for k, loss in enumerate((cauchy(), cauchy(), tukey())):
            solution = leastsq.solve(
                _pieces(rows, first, m, state.noise),
                first[1 : m + 1],
                scale=scale,
                loss=loss,
                prior=gaussian,
                tolerance=_ROUGH if k < 2 else 1e-3,
            )
            if found and _is_near(solution, found[0][1][1 : m + 1]):
                break
            first = _with_params(first, solution.params)
            scale = _scale(state, params, rows, first, m)
        else:
            found.append((scale, first))
    common = min(scale for scale, _ in found)
    costs = [_cost(rows, about, gaussian, common) for _, about in found]
    best = found[int(np.argmin(costs))][1]
    near = [
        about
        for (_, about), cost in zip(found, costs, strict=True)
        if cost < min(costs) + np.sqrt(len(rows))
    ]
    apart = np.max([np.abs(about[1:4] - best[1:4]) for about in near], axis=0)
    noise = state.noise
    if not state.noise_known:
        noise = _scale(state, params, rows, best, m)
    return best, noise, apart


def _is_near(solution: leastsq.Solution, params: Array) -> bool:
    """Whether a solution is within its standard errors of the parameters."""
    away = solution.params - params
    return float(away @ leastsq.inverse(solution.covariance) @ away) < _SAME**2


def compute_total_sd(params: TrackerParams, noise: float, about: Array) -> float:
    """The standard deviation of a residual: noise, and what the reference leaves out."""
    return float(np.hypot(noise, (params.external_sd or 0.0) / float(np.mean(about[4:7]))))


def _cost(rows: Array, about: Array, prior: GaussianPrior, scale: float) -> float:
    """How improbable a state is: a robust sum over the rows, and the prior."""
    away, _ = prior(about[1 : 1 + len(prior.centre)])
    q = (residuals_at(rows, about) / scale) ** 2
    return float(cauchy().value(q).sum() + away @ away / 2)


def _scale(state: TrackerState, params: TrackerParams, rows: Array, about: Array, m: int) -> float:
    """The standard deviation to judge residuals by: as stated, or as they are."""
    if state.noise_known:
        return compute_total_sd(params, state.noise, about)
    return max(robust_scale(residuals_at(rows, about), min(m, len(rows) - 1)), 1e-9)


def _starts(state: TrackerState, prior: FilterState, rows: Array) -> Iterator[Array]:
    """Where to begin: the estimate, and, where little is known, the sphere that most lie on."""
    yield state.estimate.state
    magnitude, gain = rows[:, 4], float(np.mean(prior.state[4:7]))
    size = float(np.mean(magnitude)) / gain
    if np.sqrt(np.diag(prior.covariance)[1:4].max()) < _CERTAIN * size:
        return
    centre = rows[:, 1:4].mean(axis=0)
    bias, scale = fit_least_median_sphere((rows[:, 1:4] - centre) / size, magnitude / (gain * size))
    if np.isfinite(bias).all() and 0.5 < scale < 2.0:
        yield np.concatenate([[0.0], centre + size * bias, prior.state[4:]])


class GaussianPrior:
    """The prior on bias and matrix as residuals: D^(−1/2) U⁻¹ (x − x₀), without the field's g."""

    def __init__(self, prior: FilterState) -> None:
        upper = prior.columns.T[1:, 1:]
        self.whiten = np.linalg.inv(upper) / np.sqrt(prior.diagonal[1:])[:, None]
        self.centre = prior.state[1 : len(prior.diagonal)]

    def __call__(self, params: Array) -> tuple[Array, Array]:
        return self.whiten @ (params - self.centre), self.whiten


def _pieces(rows: Array, about: Array, m: int, scale: float) -> leastsq.Pieces:
    def pieces(params: Array) -> Iterator[tuple[Array, Array]]:
        residuals, jacobian = linearise(rows, _with_params(about, params), scale)
        yield residuals, jacobian[:, :m]

    return pieces


def _with_params(state: Array, params: Array) -> Array:
    changed = state.copy()
    changed[0] = 0.0
    changed[1 : 1 + len(params)] = params
    return changed


def residuals_at(rows: Array, state: Array) -> Array:
    return linearise(rows, state)[0]


def linearise(rows: Array, state: Array, noise: float = 0.0) -> tuple[Array, Array]:
    """Residuals (k,) of rows about a state, and their Jacobian by bias and matrix, (k, 9)."""
    basis = model_basis("full", SYMMETRIC)
    bias, matrix = split(basis @ state[1:])
    r, jacobian = magnitude_residual(rows[:, 1:4], bias, matrix, rows[:, 4], noise)
    return r, jacobian @ basis
