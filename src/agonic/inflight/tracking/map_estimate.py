"""The most probable bias and matrix of the readings of an opening, all taken together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from agonic.arrays import Array
from agonic.calibration.tracking import TrackerParams, TrackerState
from agonic.maths.equation.affine import SYMMETRIC, magnitude_residual, model_basis, split
from agonic.maths.equation.symmetric import unpack_symmetric
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.filters.states import FilterState, Model
from agonic.maths.estimation.loss import cauchy, tukey
from agonic.maths.estimation.noise.residuals import robust_scale
from agonic.maths.estimation.robust.least_median import fit_least_median_sphere


def compute_likelihoods(
    prior: FilterState,
    models: Sequence[Model],
    times: Array,
    residual: Array,
    jacobian: Array,
    noise: Array,
) -> Array:
    """The log-likelihood (k,) of residuals (n, k) at the state of the prior under k noise models,
    −Σ (ln s + z²/2s²): `jacobian` (n, m) by the m numbers of the state, `noise` (n, k) of each; g
    of the prior is widened to `external_sd` where a model has more."""
    k, m = len(models), len(prior.diagonal)
    _, external, external_time, walk, matrix_walk, *_ = np.array(models, dtype=np.float64).T
    covariance = np.tile(prior.covariance, (k, 1, 1))
    covariance[:, 0, 0] += np.maximum(external**2 - prior.diagonal[0], 0.0)
    elapsed = np.diff(times, prepend=prior.time)
    rate = np.where(external > 0, 1.0 / external_time, 0.0)
    decay = np.exp(-elapsed[:, None] * rate)
    stirred = (1.0 - decay**2) * external**2
    walked = np.zeros((k, m))
    walked[:, 1:4], walked[:, 4:] = walk[:, None] ** 2, matrix_walk[:, None] ** 2
    kept = np.concatenate([covariance, np.zeros((k, m, 1))], axis=2)  # beside it the state
    variances = kept.reshape(k, -1)[:, :: m + 2]  # a view of the diagonals
    known, away, variance = noise**2, np.empty_like(residual), np.empty_like(residual)
    for i, h in enumerate(jacobian):
        kept[:, 0] *= decay[i, :, None]
        kept[:, :, 0] *= decay[i, :, None]
        variances += elapsed[i] * walked
        variances[:, 0] += stirred[i]
        shared = h @ kept
        shared[:, m] += residual[i]
        away[i] = shared[:, m]
        variance[i] = shared[:, :m] @ h + known[i]
        gain = shared[:, :m] / variance[i, :, None]
        kept -= gain[:, :, None] * shared[:, None, :]
    return np.asarray(-0.5 * (np.log(variance) + away**2 / variance).sum(axis=0))


MEMORY_FROM = 192
"""Readings that can show a memory."""


def find_memory(
    prior: FilterState, model: Model, rows: Array, about: Array, total: float
) -> Model | None:
    """The noise model whose lasting part makes rows (k, 6) most probable; None where what is given
    does as well. Residuals are linear about a state (10,) and have the sd `total`.

    A filter that takes lasting errors for white ones learns each of them many times. The errors of
    the reference and those of a sensor, seen along the field, are one Gauss–Markov process beside
    the bias (`kalman`).
    """
    # the variance of a residual is lost in rounding
    if total**2 < 1e-14 * prior.covariance.diagonal()[1:].max():
        return None
    step, gain = float(np.median(np.diff(rows[:, 0]))), float(np.mean(about[4:7]))
    rows = rows[-2048:]  # the latest show it
    plain = model._replace(gate=np.inf)
    tried = [
        plain._replace(
            noise=total * float(np.sqrt(1 - share)),
            external_sd=total * gain * float(np.sqrt(share)),
            external_time_s=time * step,
        )
        for time in (1.5, 3.0, 6.0, 12.0, 25.0, 50.0, 100.0, 200.0, 400.0)
        if time * 4 < len(rows)  # of longer ones nothing is seen
        for share in (0.15, 0.5, 0.8, 0.97)  # of the variance that lasts
    ]
    models, rows, m = [plain, *tried], rows[rows[:, 5] > 0], len(prior.diagonal)
    noise = np.array([one.noise for one in models])
    bare, jacobian = linearise(rows, about)
    bent = linearise(rows, about, float(noise.max()))[0] - bare  # as the square of the noise
    matrix = unpack_symmetric(about[4:])
    u = (rows[:, 1:4] - about[1:4]) @ matrix
    steep = np.linalg.norm(u @ matrix, axis=1) / np.linalg.norm(u, axis=1)  # |s|: to nT
    h = np.column_stack([-np.ones(len(rows)), jacobian * steep[:, None]])[:, :m]
    residual = steep[:, None] * (bare[:, None] + bent[:, None] * (noise / noise.max()) ** 2)
    residual += (h @ (prior.state - about)[:m])[:, None]
    without, *values = compute_likelihoods(
        prior, models, rows[:, 0], residual, h, steep[:, None] * noise
    )
    return tried[int(np.argmax(values))] if max(values) > without + 10.0 else None  # log-likelihood


_SAME = 1.0  # standard error: ways that come so near each other end in one place


def find_most_probable(
    state: TrackerState, prior: FilterState, rows: Array, params: TrackerParams
) -> tuple[Array, float, Array]:
    """The most probable state (10,) of the rows as if nothing moved, the noise, and how far from
    it the bias (3,) is in states nearly as probable: by a chance of √n, for another direction sees
    another component of the noise, whose sum of squares over n readings differs by so much."""
    m, gaussian = len(prior.diagonal) - 1, make_gaussian(prior)
    found: list[tuple[float, Array]] = []
    visited: list[Array] = []
    for first in _list_starts(state, prior, rows):
        scale = max(
            _measure_sd(state, params, rows, first, m), robust_scale(linearise(rows, first)[0])
        )
        for loss in (cauchy(), tukey()):
            solution = leastsq.solve(
                _make_pieces(rows, first, m, state.noise),
                first[1 : m + 1],
                scale=scale,
                loss=loss,
                prior=gaussian,
                # the filter steps on from it
                tolerance=0.1,
                max_iterations=12,
            )
            information = leastsq.inverse(solution.covariance)
            apart = [solution.params - values for values in visited]
            if found and any(one @ information @ one < _SAME**2 for one in apart):
                break
            if not found:
                visited.append(solution.params)
            first = _with_params(first, solution.params)
            scale = _measure_sd(state, params, rows, first, m)
        else:
            found.append((scale, first))
    common = min(scale for scale, _ in found)
    costs = [_compute_cost(rows, about, gaussian, common, m) for _, about in found]
    best = found[int(np.argmin(costs))][1]
    limit = min(costs) + np.sqrt(len(rows))
    near = [about for (_, about), cost in zip(found, costs, strict=True) if cost < limit]
    far = np.max([np.abs(about[1:4] - best[1:4]) for about in near], axis=0)
    noise = state.noise if state.noise_known else _measure_sd(state, params, rows, best, m)
    return best, noise, far


def _measure_sd(
    state: TrackerState, params: TrackerParams, rows: Array, about: Array, m: int
) -> float:
    """The standard deviation of a residual: as stated, or as they are, less m unknowns."""
    if state.noise_known:
        return compute_total_sd(params, state.noise, about)
    return max(robust_scale(linearise(rows, about)[0], min(m, len(rows) - 1)), 1e-9)


def _compute_cost(rows: Array, about: Array, prior: leastsq.Prior, scale: float, m: int) -> float:
    """How improbable a state is: a robust sum over the rows, and the prior."""
    away, _ = prior(about[1 : m + 1])
    q = (linearise(rows, about)[0] / scale) ** 2
    return float(cauchy().value(q).sum() + away @ away / 2)


def _with_params(state: Array, params: Array) -> Array:
    changed = state.copy()
    changed[0], changed[1 : 1 + len(params)] = 0.0, params
    return changed


def _make_pieces(rows: Array, about: Array, m: int, noise: float) -> leastsq.Pieces:
    def pieces(params: Array) -> Iterator[tuple[Array, Array]]:
        residuals, jacobian = linearise(rows, _with_params(about, params), noise)
        yield residuals, jacobian[:, :m]

    return pieces


def compute_total_sd(params: TrackerParams, noise: float, about: Array) -> float:
    """The standard deviation of a residual: noise, and what the reference leaves out."""
    return float(np.hypot(noise, (params.external_sd or 0.0) / float(np.mean(about[4:7]))))


def _list_starts(state: TrackerState, prior: FilterState, rows: Array) -> Iterator[Array]:
    """Where to begin: the estimate, and, where little is known, the sphere that most lie on."""
    yield state.estimate.state
    magnitude, gain = rows[:, 4], float(np.mean(prior.state[4:7]))
    size = float(np.mean(magnitude)) / gain
    if np.sqrt(np.diag(state.estimate.covariance)[1:4].max()) < 0.1 * size:
        return
    centre = rows[:, 1:4].mean(axis=0)
    bias, scale = fit_least_median_sphere((rows[:, 1:4] - centre) / size, magnitude / (gain * size))
    if np.isfinite(bias).all() and 0.5 < scale < 2.0:
        yield np.concatenate([[0.0], centre + size * bias, prior.state[4:]])


def make_gaussian(prior: FilterState) -> leastsq.Prior:
    """The prior on bias and matrix as residuals: D^(−1/2) U⁻¹ (x − x₀), without the field's g."""
    whiten = np.linalg.inv(prior.columns.T[1:, 1:]) / np.sqrt(prior.diagonal[1:])[:, None]
    centre = prior.state[1 : len(prior.diagonal)]
    return lambda params: (whiten @ (params - centre), whiten)


def linearise(rows: Array, state: Array, noise: float = 0.0) -> tuple[Array, Array]:
    """Residuals (k,) of rows about a state, and their Jacobian by bias and matrix, (k, 9)."""
    basis = model_basis("full", SYMMETRIC)
    bias, matrix = split(basis @ state[1:])
    r, jacobian = magnitude_residual(rows[:, 1:4], bias, matrix, rows[:, 4], noise)
    return r, jacobian @ basis
