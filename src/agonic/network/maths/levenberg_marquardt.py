"""Levenberg–Marquardt backpropagation: the weights of a network from inputs and targets.

The step of Wang et al. (2020), Eq. 14, with the weights themselves kept small by λ:

    Δω = −(JᵀJ + (λ + μ) I)⁻¹ (Jᵀe + λ ω)

μ falls tenfold after a step that helped and rises tenfold after one that did not. λ is zero, or
taken from the data themselves by MacKay's evidence (Foresee & Hagan 1997):

    γ = Σ ℓ/(ℓ + λ),   α = γ/|ω|²,   β = (N − γ)/Σe²,   λ = α/β

with ℓ the eigenvalues of JᵀJ, γ the number of weights that the data determine, and N the number of
residuals, counted as fewer where successive ones are alike.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from agonic.arrays import Array, Index, Mask
from agonic.maths.equation import network
from agonic.maths.equation.network import Nodes, Shape
from agonic.maths.estimation.leastsq import inverse

Stopping = Literal["bayesian", "early", "plain"]

SLOW = 0.02
"""Training ends when steps gain less log-likelihood than this, one after the other,"""
FLAT = 1e-4
"""or less than this share of what is left."""
PATIENCE = 6
_SETTLING = 8  # epochs before the evidence is asked: far from the minimum it says nothing
_FEW = 1000  # rows on which starts are tried


class Problem(NamedTuple):
    """Scaled inputs (n, i) and targets (n, o); weights (n,) or None; correlation length, rows."""

    x: Array
    target: Array
    hidden: Nodes
    weight: Array | None = None
    correlation: float = 1.0

    @property
    def shape(self) -> Shape:
        """The shape of the network."""
        return Shape(self.x.shape[1], self.hidden, self.target.shape[1])

    def subset(self, rows: Index | Mask) -> Problem:
        """The same problem on some of the rows."""
        weight = None if self.weight is None else self.weight[rows]
        return self._replace(x=self.x[rows], target=self.target[rows], weight=weight)


class Epoch(NamedTuple):
    """One accepted step: mean square errors (scaled), of rows held out or NaN, μ, and γ."""

    mean_square: float
    held_out: float
    mu: float
    effective: float


class Training(NamedTuple):
    """The weights, their posterior covariance, and how training went.

    `precision` is β, the reciprocal variance of a scaled residual, and `ridge` λ.
    """

    weights: Array
    covariance: Array
    precision: float
    ridge: float
    effective: float
    epochs: tuple[Epoch, ...]
    converged: bool

    @property
    def mean_square(self) -> float:
        """Mean square error of the scaled outputs at the end."""
        return self.epochs[-1].mean_square if self.epochs else float("nan")


def train(
    problem: Problem,
    start: Array,
    *,
    stopping: Stopping = "bayesian",
    held_out: Problem | None = None,
    ridge: float | None = None,
    most_epochs: int = 300,
) -> Training:
    """The weights that fit best from a start, (m,).

    Parameters: `stopping` how overfitting is met: "bayesian" by λ from the evidence, "early" by the
    error on `held_out`, "plain" not at all; `ridge` λ to begin with, as a training before left it.
    """
    evidence = stopping == "bayesian"
    weights: Array = np.array(start, dtype=np.float64)
    sums = _sums(problem, weights)
    first = ridge or (1e-3 * sums.weight**0.5 if evidence else 0.0)
    state = _State(weights, sums, first, 1e-3, float(len(weights)))
    watched = held_out if stopping == "early" else None
    best, least, worse = weights, np.inf, 0  # with the least error held out, and epochs since then
    if watched is not None:
        least = _mean_square(watched, weights)
    epochs: list[Epoch] = []
    slow, converged, rows = 0, False, max(sums.weight, 1e-300) * problem.target.shape[1]
    while len(epochs) < most_epochs and not converged:
        if evidence and (ridge is not None or len(epochs) >= _SETTLING):
            state = _update_ridge(problem, state)
        stepped = _step(problem, state)
        if stepped is None:
            converged = True
            break
        gain, state = stepped
        unseen = float("nan")
        if watched is not None:
            unseen = _mean_square(watched, state.weights)
            worse += 1
            if unseen < least:
                best, least, worse = state.weights, unseen, 0
        mean_square = float(state.sums.square / rows)
        epochs.append(Epoch(mean_square, unseen, state.mu, state.effective))
        ready = not evidence or ridge is not None or len(epochs) > _SETTLING
        enough = max(SLOW, FLAT * _count(problem, state.sums) / 2)
        slow = slow + 1 if gain < enough and ready else 0
        converged = slow >= PATIENCE or worse >= PATIENCE
    if watched is not None:
        state = state._replace(weights=best, sums=_sums(problem, best))
    return _conclude(problem, state, tuple(epochs), converged)


def _conclude(
    problem: Problem, state: _State, epochs: tuple[Epoch, ...], converged: bool
) -> Training:
    """The weights of a state with their covariance."""
    precision = _precision(problem, state.sums, min(state.effective, len(state.weights)))
    information = state.sums.information.copy()
    smallest = 1e-9 * float(np.trace(information)) / len(information)
    information[np.diag_indices_from(information)] += max(state.ridge, smallest)
    return Training(
        weights=state.weights,
        covariance=inverse(information * precision),
        precision=precision * problem.correlation,
        ridge=state.ridge,
        effective=state.effective,
        epochs=epochs,
        converged=converged,
    )


class Start(NamedTuple):
    """Weights to start from, and the epochs that led there from where they were drawn."""

    weights: Array
    epochs: tuple[Epoch, ...] = ()


def choose_start(
    problem: Problem, *, seed: int, restarts: int, held_out: Problem | None = None
) -> Start:
    """The most promising of several random starts: on some of the rows the better half goes on for
    twice as many epochs, until one is left; with `held_out` the least error there decides."""
    rng = np.random.default_rng(seed)
    few = problem
    if len(problem.x) > _FEW:
        few = problem.subset(np.sort(rng.choice(len(problem.x), _FEW, replace=False)))
    left = [Start(network.draw_weights(rng, problem.shape)) for _ in range(restarts)]
    if held_out is not None:
        stopped = [train(problem, w, stopping="early", held_out=held_out) for w, _ in left]
        best = min(stopped, key=lambda one: min((e.held_out for e in one.epochs), default=np.inf))
        return Start(best.weights, best.epochs)

    def go_on(start: Start, epochs: int) -> Start:
        trained = train(few, start.weights, stopping="plain", most_epochs=epochs)
        return Start(trained.weights, start.epochs + trained.epochs)

    epochs = 8
    while len(left) > 1:
        tried = [go_on(start, epochs) for start in left]
        tried.sort(key=lambda start: start.epochs[-1].mean_square)
        left, epochs = tried[: len(tried) // 2], 2 * epochs
    return left[0] if few is problem or restarts == 1 else go_on(left[0], 200)


class _State(NamedTuple):
    """Where training stands."""

    weights: Array
    sums: network.Sums
    ridge: float
    mu: float
    effective: float


def _sums(problem: Problem, weights: Array) -> network.Sums:
    layers = network.split(weights, problem.shape)
    return network.sum_normal_equations(layers, problem.x, problem.target, problem.weight)


def _square(problem: Problem, weights: Array) -> float:
    layers = network.split(weights, problem.shape)
    return network.square_error(layers, problem.x, problem.target, problem.weight)


def _mean_square(problem: Problem, weights: Array) -> float:
    total = len(problem.x) if problem.weight is None else float(problem.weight.sum())
    return float(_square(problem, weights) / (max(total, 1e-300) * problem.target.shape[1]))


def _step(problem: Problem, state: _State) -> tuple[float, _State] | None:
    """The next step that helps, and what log-likelihood it gains; None where none does."""
    weights, sums, ridge = state.weights, state.sums, state.ridge
    objective = sums.square + ridge * float(weights @ weights)
    gradient = sums.gradient + ridge * weights
    mu = state.mu
    while mu < 1e10:
        damped = sums.information.copy()
        damped[np.diag_indices_from(damped)] += ridge + mu
        try:
            step = cho_solve(cho_factor(damped), -gradient)
        except np.linalg.LinAlgError:
            mu *= 10.0
            continue
        trial = weights + step
        now = _square(problem, trial) + ridge * float(trial @ trial)
        if now < objective:
            gain = 0.5 * (objective - now) * _precision(problem, sums, state.effective)
            fresh = _sums(problem, trial)
            return gain, state._replace(weights=trial, sums=fresh, mu=max(mu / 10.0, 1e-20))
        mu *= 10.0
    return None


def _count(problem: Problem, sums: network.Sums) -> float:
    """How many residuals there are, those that are alike counted once."""
    return float(sums.weight * problem.target.shape[1] / problem.correlation)


def _precision(problem: Problem, sums: network.Sums, effective: float) -> float:
    """β/ν: the reciprocal variance of a scaled residual, over the correlation length."""
    freedom = max(_count(problem, sums) - effective, 1.0)
    return freedom / max(sums.square, 1e-300)


def _update_ridge(problem: Problem, state: _State) -> _State:
    """γ, and λ by the evidence."""
    values = np.maximum(np.linalg.eigvalsh(state.sums.information), 0.0)
    effective = float((values / (values + state.ridge)).sum()) if state.ridge else len(values)
    size = max(float(state.weights @ state.weights), 1e-300)
    precision = _precision(problem, state.sums, effective)
    ridge = max(effective, 1e-3) / size / precision
    return state._replace(ridge=float(ridge), effective=float(effective))
