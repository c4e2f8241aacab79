"""W(T) and b(T) from the mean readings of turned stations in a field of unknown direction.

The magnitude of the field teaches as on an ellipsoid; where the turns between the stations are
known, the direction at a station is one unknown too and does not change with temperature, and a
prior ties it to the described turn. What scatters, how far stations stand off, and how much the
field changed slowly is told by the readings themselves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.kernels import fixture, leastsq
from agonic.kernels.noise import noise_of
from agonic.kernels.positions import (
    Poses,
    Problem,
    State,
    directions,
    parameters,
    posed,
    residuals,
    steady,
    stepped,
)

Array = NDArray[np.float64]

_FIRST_EXCESS = 0.01**2
_FIRST_SLOW = 0.001
_ROUNDS = 25
_FREE = 4
_STRAY = 5.0
_LEAST_SLOW = 1e-7
_LEAST_TURN = 1e-7  # rad: the fixture is never believed to be better than this


class Estimate(NamedTuple):
    """The most probable coefficients (a,) and their covariance, and what the cells say.

    `residuals` are (m,) where the magnitude taught and (m, 3) where the vector did, in the
    normalised unit, and `weights` (m,) what the robust loss left of each mean; `excess` is the
    variance by which means scatter beyond their noise; `drift` (1,) or (3,) how the field changed
    over the campaign (along itself, or in the chamber's axes), with its covariance, and `slow_sd`
    the standard deviation of each function that the field may have followed at a station; `unrest`
    says by how many standard deviations it shows that there are some. Only
    where turns are known: `poses`, `fixture_sd` (rad), and `turned` (k,), the angle by which each
    station stood off.
    """

    coefficients: Array
    covariance: Array
    residuals: Array
    weights: Array
    excess: float
    correlation: float
    condition: float
    iterations: int
    converged: bool
    drift: Array
    drift_covariance: Array
    slow_sd: float
    unrest: float
    poses: Poses | None = None
    fixture_sd: float = 0.0
    turned: Array | None = None


def by_magnitude(problem: Problem, start: Array) -> Estimate:
    """The coefficients that the magnitude alone teaches, from a start near enough."""
    return _settled(problem._replace(rot_nb=None), start, None)


def by_turns(problem: Problem, start: Array) -> Estimate:
    """The coefficients that magnitude and known turns teach, from those of the magnitude."""
    assert problem.rot_nb is not None
    seen = directions(problem, start)
    found = fixture.mounted(seen, problem.rot_nb)
    return _settled(problem, start, Poses(seen, found.mount, found.field))


def _settled(problem: Problem, start: Array, poses: Poses | None) -> Estimate:
    """Solve, renew weights, directions, excess and beliefs, until nothing changes."""
    width = problem.clock.shape[1] * (1 if poses is None else 3)
    first = _FIRST_EXCESS if not problem.changing else 0.0
    state = State(start, np.zeros(width), poses, first, problem.fixture_sd, _FIRST_SLOW)
    loss, correlation, iterations = leastsq.squares(), 1.0, 0
    for turn in range(_ROUNDS):
        pieces, prior = posed(problem, state)
        params = parameters(state, len(start))
        solution = leastsq.solve(
            pieces, params, scale=1.0, loss=loss, prior=prior, correlation=correlation,
            tolerance=1e-3 if turn > 2 else 1e-1,
        )  # fmt: skip
        iterations += solution.iterations
        before, state = state, _renewed(problem, state, solution)
        left, variance = residuals(problem, state)
        excess = _excess(left, variance, _effective(solution))
        noise = noise_of(_whitened(left, variance + excess).T.ravel(), True, _effective(solution))
        same = abs(excess - before.excess) <= 1e-2 * (excess + float(np.median(variance)))
        calm = abs(np.log(noise.correlation / correlation)) < 0.05
        rested = abs(state.fixture_sd / before.fixture_sd - 1) < 0.02
        rested &= abs(state.slow_sd / before.slow_sd - 1) < 0.05
        loss = noise.loss
        if not problem.changing or turn >= _FREE:  # first the slow changes take what is theirs
            correlation = noise.correlation
            state = state._replace(excess=excess)
        still = same and calm and rested and solution.iterations <= 2
        if still and turn > (1 if not problem.changing else _FREE):
            break
    return _estimate(problem, state, solution, loss, correlation, iterations)


def _unrest(problem: Problem, state: State) -> float:
    """How far the slow part of the residuals exceeds what noise makes, in standard deviations.

    With Q the slow functions of all stations, orthonormal under the weights, and r = (1 − H)ε what
    the fit leaves of white noise, qᵀq of q = Qᵀr has the mean tr V and the variance 2 tr V²,
    V = Qᵀ(1 − H)Q. Changes of the field that no single mean shows are seen so.
    """
    if problem.slow is None or problem.changing:
        return 0.0
    pieces, prior = posed(problem, state._replace(excess=0.0))
    params = parameters(state, problem.layout.shape[1])
    z, jacobian = next(iter(pieces(params)))
    beliefs = prior(params)[1]
    covariance = leastsq.inverse(jacobian.T @ jacobian + beliefs.T @ beliefs)
    noise = np.sqrt(np.einsum("mii->m", problem.covariance))
    axis, _ = np.linalg.qr(problem.own / noise[:, None])
    axes = len(z) // len(axis)
    z = np.clip(z, -_STRAY, _STRAY).reshape(axes, -1)
    q = (z @ axis).ravel()
    by = np.einsum("ams,amp->asp", np.broadcast_to(axis, (axes, *axis.shape)),
                   jacobian.reshape(axes, len(axis), -1)).reshape(len(q), -1)  # fmt: skip
    v = np.eye(len(q)) - by @ covariance @ by.T
    return float((q @ q - np.trace(v)) / np.sqrt(2 * np.sum(v * v)))


def _effective(solution: leastsq.Solution) -> int:
    """How many parameters the readings determined: of those that the prior holds, a part."""
    return round(float(np.trace(solution.covariance @ solution.information)))


def _excess(left: Array, variance: Array, parameters: int) -> float:
    """The variance τ² that brings Σ r²/(v + τ²) to the degrees of freedom; 0 where none is needed.

    Strays, far beyond the median, do not count.
    """
    r, v = left.ravel(), np.broadcast_to(variance, left.shape).ravel()
    freedom = max(len(r) - parameters, 1)
    share = freedom / len(r)

    def surplus(tau: float) -> float:
        q = r**2 / (v + tau)
        kept = q < 36 * max(float(np.median(q)), 1e-300) * 2.2
        return float(q[kept].mean()) / share - 1

    if surplus(0.0) < 3 * np.sqrt(2 / freedom):
        return 0.0
    low, high = 0.0, float(np.max(r**2)) + 1e-300
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if surplus(middle) > 0 else (low, middle)
    return high


def _whitened(left: Array, variance: Array) -> Array:
    return np.asarray(left / np.sqrt(np.broadcast_to(variance, left.shape)))


def _renewed(problem: Problem, state: State, solution: leastsq.Solution) -> State:
    """The state at a solution, with the belief in the fixture that its residuals call for."""
    a, width = problem.layout.shape[1], len(state.drift)
    params = solution.params
    new = state._replace(coefficients=params[:a], drift=params[a : a + width])
    z, rows = posed(problem, state)[1](params)
    if problem.changing:
        first = a + steady(problem, state)
        own = np.flatnonzero(np.any(rows[:, first : a + width] != 0, axis=1))
        sd = _believed(solution, z, rows, slice(int(own[0]), int(own[-1]) + 1))
        new = new._replace(slow_sd=max(state.slow_sd * sd, _LEAST_SLOW))
    if state.poses is None:
        return new
    k, first = problem.stations, a + width
    poses = stepped(state.poses, params[first:], k)
    if problem.fixture_known:
        return new._replace(poses=poses)
    sd = _believed(solution, z, rows, slice(len(z) - 2 * k, len(z)))
    return new._replace(poses=poses, fixture_sd=max(state.fixture_sd * sd, _LEAST_TURN))


def _believed(solution: leastsq.Solution, z: Array, rows: Array, own: slice) -> float:
    """By what some of the beliefs should be loosened, for them to be as large as they look.

    MacKay's (1992) update of a prior's width, s² ← Σz²/γ with γ the number of beliefs that the
    readings contradict freely, repeated on the linearised problem until it stands.
    """
    rest = np.ones(len(z), dtype=bool)
    rest[own] = False
    others, count = np.flatnonzero(rest), own.stop - own.start
    gradient = -(z @ rows)  # of the readings: at the minimum the beliefs balance it
    held = solution.information + rows[others].T @ rows[others]
    pull, scale = rows[own].T @ rows[own], 1.0
    for _ in range(30):
        covariance = leastsq.inverse(held + pull / scale**2)
        step = -covariance @ (gradient + z[others] @ rows[others] + z[own] @ rows[own] / scale**2)
        left = z[own] + rows[own] @ step
        free = count - float(np.trace(covariance @ pull)) / scale**2
        before, scale = scale, max(float(np.sqrt(left @ left / max(free, 1.0))), 1e-6)
        if abs(scale / before - 1) < 1e-3:
            break
    return scale


def _estimate(
    problem: Problem, state: State, solution: leastsq.Solution, loss: leastsq.Loss,
    correlation: float, iterations: int,
) -> Estimate:  # fmt: skip
    a = problem.layout.shape[1]
    drift = steady(problem, state)
    left, variance = residuals(problem, state)
    q = _whitened(left, variance + state.excess) ** 2
    turned = None
    if state.poses is not None:
        assert problem.rot_nb is not None
        in_box = np.swapaxes(problem.rot_nb, 1, 2) @ state.poses.field
        away = np.linalg.norm(state.poses.directions @ state.poses.mount.T - in_box, axis=1)
        turned = 2 * np.arcsin(np.minimum(away / 2, 1.0))
    return Estimate(
        coefficients=state.coefficients,
        covariance=solution.covariance[:a, :a],
        residuals=left.squeeze(axis=1) if left.shape[1] == 1 else left,
        weights=np.asarray(loss.weight(q).min(axis=1)),
        excess=state.excess,
        correlation=correlation,
        condition=leastsq.condition(solution.covariance[:a, :a]),
        iterations=iterations,
        converged=solution.converged,
        drift=state.drift[:drift],
        drift_covariance=solution.covariance[a : a + drift, a : a + drift],
        slow_sd=state.slow_sd if problem.changing else 0.0,
        unrest=_unrest(problem, state),
        poses=state.poses,
        fixture_sd=state.fixture_sd,
        turned=turned,
    )
