"""W(T) and b(T) from the mean readings of turned stations in a field of unknown direction.

The reference is the magnitude of the field, as on an ellipsoid; where the orientations of the
stations are known, the direction at a station is one unknown too and does not change with
temperature, and a prior ties it to the described orientation. What scatters, how far stations stand
off, and how much the field changed slowly is estimated from the readings themselves (empirical
Bayes).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.loss import Loss, squares
from agonic.maths.estimation.noise.residuals import estimate_noise, robust_scale
from agonic.model.average import Base, Group, average
from agonic.model.terms.time import TIME
from agonic.thermal.maths import gaussian_process, stations
from agonic.thermal.maths.prior import estimate_width, make_prior, step_poses
from agonic.thermal.maths.station_residuals import (
    Poses,
    State,
    StationProblem,
    collect_parameters,
    compute_residuals,
    find_directions,
    make_pieces,
    project_changes,
)

_FIRST_EXCESS = 0.01**2
UNREST = 16.0
"""Twice the logarithm of the likelihood by which slow changes must show to be spoken of."""
RARE, LIKELY = 0.05, 0.5
"""Probability of a drift before the readings are seen: of a field at rest, of one that changes; a
bias ages as seldom as a field at rest drifts, where directions tell one from the other."""
AGED = 0.2
"""That of a bias that aged by the magnitude alone, which shows 20 nT a day too little."""
HARDLY = 0.001
"""The same by the magnitude alone beside slow changes of the field: twelve magnitudes are hardly
more than the numbers that they determine; what changes from station to station fits as ageing."""
IMPLAUSIBLE = 0.015
"""Slow changes of the field that are larger, over the field, stand in for something else."""
_ROUNDS = 25
_FREE = 4
OUTLIER = 5.0
_LEAST_ANGLE = 1e-7  # rad: the prior of the fixture is never narrower than this


class StationEstimate(NamedTuple):
    """The most probable coefficients (a,) and their covariance, and what the cells say.

    `residuals` are (m,) from the magnitude and (m, 3) from the vector, in the normalised unit, and
    `weights` (m,) what the robust loss left of each mean; `excess` is the variance by which means
    scatter beyond their noise; `drift` (1,) or (3,) how the field changed over the campaign (along
    itself, or in the chamber's axes), `ageing` (0,) or (3,) how the bias did, with their
    covariances; `slow` the field's slow changes at each station. Only where turns are known:
    `poses`, `fixture_sd` (rad), `turned` (k,), the angle by which each station stood off, and the
    covariance (2k, 2k) of the directions along their tangents.
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
    ageing: Array
    ageing_covariance: Array
    slow: gaussian_process.GaussianProcess
    poses: Poses | None = None
    fixture_sd: float = 0.0
    turned: Array | None = None
    directions_covariance: Array | None = None


def estimate_by_magnitude(problem: StationProblem, start: Array) -> StationEstimate:
    """The coefficients from the magnitude alone, from a start near enough."""
    return _iterate(problem._replace(rot_nb=None), start, None)


def estimate_by_orientations(
    problem: StationProblem, start: Array, slow: gaussian_process.GaussianProcess | None = None
) -> StationEstimate:
    """The coefficients from magnitude and known orientations, from those of the magnitude.

    `slow` are the changes that the magnitude showed, near whose kind those of all axes are looked
    for.
    """
    assert problem.rot_nb is not None
    seen = find_directions(problem, start)
    found = stations.find_mounting(seen, problem.rot_nb)
    kinds = gaussian_process.KINDS if slow is None else gaussian_process.list_near_kinds(slow)
    return _iterate(problem, start, Poses(seen, found.mount, found.field), kinds)


def _iterate(
    problem: StationProblem,
    start: Array,
    poses: Poses | None,
    kinds: tuple[gaussian_process.Kind, ...] = gaussian_process.KINDS,
) -> StationEstimate:
    """Solve, renew weights, directions, slow changes, excess and prior, until nothing changes."""
    state = _start(problem, start, poses)
    loss, correlation, iterations, taken = squares(), 1.0, 0, 0.0
    for turn in range(_ROUNDS):
        solution = leastsq.solve(
            make_pieces(problem, state),
            collect_parameters(state, len(start)),
            scale=1.0,
            loss=loss,
            prior=make_prior(problem, state),
            correlation=correlation,
            tolerance=1e-3 if turn > 2 else 1e-1,
        )
        iterations += solution.iterations
        before, state = state, _renew(problem, state, solution)
        first = problem.course is not None and turn < _FREE  # slow changes take what is theirs
        state = state._replace(excess=0.0) if first else state
        if turn < _FREE or state.slow.sd > 0:  # what was not seen so far is not there
            known = kinds if turn == 0 else (state.slow.kind,)
            state, taken = _renew_slow_changes(problem, state, known)
        left, variance = compute_residuals(problem, state)
        freedom = round(float(np.trace(solution.covariance @ solution.information))) + round(taken)
        excess = _estimate_excess(left, variance, freedom)
        noise = estimate_noise(_whiten(left, variance + excess).T.ravel(), True, freedom)
        same = abs(excess - before.excess) <= 1e-2 * (excess + float(np.median(variance)))
        calm = abs(np.log(noise.correlation / correlation)) < 0.05
        rested = abs(state.fixture_sd / before.fixture_sd - 1) < 0.02
        rested &= abs(state.slow.sd - before.slow.sd) <= 0.05 * before.slow.sd
        loss = noise.loss
        if not first:
            correlation, state = noise.correlation, state._replace(excess=excess)
        if same and calm and rested and solution.iterations <= 2 and turn > 1:
            if (
                problem.pace is None
                or len(state.ageing)
                or (_resemble_ageing(state) and state.slow.gain > UNREST)
            ):
                break
            state = state._replace(ageing=np.zeros(3))  # not before slow changes have theirs
    return _summarise(problem, state, solution, loss, correlation, iterations)


def _start(problem: StationProblem, coefficients: Array, poses: Poses | None) -> State:
    """The state before the first solution: nothing changed with time."""
    axes = 1 if poses is None else 3
    return State(
        coefficients,
        drift=np.zeros(problem.clock.shape[1] * (axes if problem.turns_known else 1)),
        ageing=np.zeros(0),
        poses=poses,
        excess=_FIRST_EXCESS,
        fixture_sd=problem.fixture_sd,
        slow=gaussian_process.GaussianProcess(),
        followed=np.zeros((len(problem.points), axes)),
    )


def _resemble_ageing(state: State) -> bool:
    """Whether slow changes of the field look like ageing, as they do by the magnitude alone."""
    changes = state.slow.sd > 0 and state.slow.kind != gaussian_process.STEADY
    return state.poses is None and changes


def _renew_slow_changes(
    problem: StationProblem, state: State, kinds: tuple[gaussian_process.Kind, ...]
) -> tuple[State, float]:
    """The state with the slow changes that its residuals call for, and the freedom they take."""
    if problem.course is None:
        return state, 0.0
    params = collect_parameters(state, problem.layout.shape[1])
    z, jacobian = next(
        iter(make_pieces(problem, state._replace(slow=gaussian_process.GaussianProcess()))(params))
    )
    expected, by = make_prior(problem, state)(params)
    covariance = leastsq.inverse(jacobian.T @ jacobian + by.T @ by)
    step = -covariance @ (z @ jacobian + expected @ by)
    least = z + jacobian @ step  # outliers stand out where the rest fits
    limit = OUTLIER * max(robust_scale(least), 1.0)
    kept, of = np.clip(least, -limit, limit), project_changes(problem, state)
    slow, axes = gaussian_process.estimate_process(
        of, kept, jacobian, (expected + by @ step, by), kinds
    )
    if slow.sd > IMPLAUSIBLE and len(state.ageing):
        slow, axes = state.slow, gaussian_process.find_principal_axes(of, state.slow.kind)
    if slow.sd > IMPLAUSIBLE:  # it stands in for something else that does not fit
        return state._replace(
            slow=gaussian_process.GaussianProcess(), followed=np.zeros_like(state.followed)
        ), 0.0
    z = z + kept - least
    changes, taken = gaussian_process.predict_changes(of, slow, axes, z, len(problem.points))
    return state._replace(slow=slow, followed=changes), taken


def _estimate_excess(left: Array, variance: Array, parameters: int) -> float:
    """The variance τ² that brings Σ r²/(v + τ²) to the degrees of freedom; 0 where none is needed.

    Outliers, far beyond the median, do not count.
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


def _whiten(left: Array, variance: Array) -> Array:
    return np.asarray(left / np.sqrt(np.broadcast_to(variance, left.shape)))


def _move(problem: StationProblem, state: State, params: Array) -> State:
    """The state at parameters."""
    a = problem.layout.shape[1]
    aged, after = a + len(state.drift), a + state.trends
    new = state._replace(coefficients=params[:a], drift=params[a:aged], ageing=params[aged:after])
    if state.poses is None:
        return new
    return new._replace(poses=step_poses(state.poses, params[after:], problem.stations))


def _renew(problem: StationProblem, state: State, solution: leastsq.Solution) -> State:
    """The state at a solution, with the prior of the fixture as wide as its residuals call for."""
    new = _move(problem, state, solution.params)
    if state.poses is None or problem.fixture_known:
        return new
    z, rows = make_prior(problem, state)(solution.params)
    sd = estimate_width(solution, z, rows, slice(len(z) - 2 * problem.stations, len(z)))
    return new._replace(fixture_sd=max(state.fixture_sd * sd, _LEAST_ANGLE))


def _add_half(covariance: Array, aged: Array, ageing: slice, p: int) -> Array:
    """The covariance with half of what the bias aged by (3,) in that of the bias.

    The coefficients are those of the middle, and the sensor is used at the end.
    """
    constant, added = [0, p, 2 * p], covariance.copy()
    added[np.ix_(constant, constant)] += (np.outer(aged, aged) + covariance[ageing, ageing]) / 4
    return added


def _average_over_size(
    params: Array, covariance: Array, term: slice, odds: float
) -> tuple[Array, Array]:
    """Parameters (p,) and covariance averaged over how large a steady change is (`model.average`).

    With d and V of the term, information and score beside all others are V⁻¹ and V⁻¹ d; the others
    follow it along C_od V⁻¹.
    """
    d, spread = params[term], covariance[term, term]
    information, nature, k = leastsq.inverse(spread), TIME[0], len(d)
    gram = np.zeros((k + 1, k + 1))
    gram[:k, :k], gram[:k, k] = information, information @ d
    beside = Base(np.zeros(0, dtype=np.intp), np.zeros((0, 0)), np.zeros(0), 0.0)
    group = Group(nature.name, np.arange(k), nature.scale, odds, nature.most)
    one = average(gram, beside, group)
    by = covariance[:, term] @ information
    return params - by @ (d - one.mean), covariance + by @ (one.covariance - spread) @ by.T


def _summarise(
    problem: StationProblem,
    state: State,
    solution: leastsq.Solution,
    loss: Loss,
    correlation: float,
    iterations: int,
) -> StationEstimate:
    a = problem.layout.shape[1]
    drift = slice(a, a + len(state.drift))
    ageing = slice(drift.stop, a + state.trends)
    found, covariance = solution.params, solution.covariance
    if state.trends:
        likely = LIKELY if state.slow.gain > UNREST else RARE
        if len(state.ageing):
            aged = AGED if state.poses is None else RARE
            aged = HARDLY if _resemble_ageing(state) else aged
            found, covariance = _average_over_size(found, covariance, ageing, aged)
            covariance = _add_half(covariance, found[ageing], ageing, problem.degree + 1)
        if not problem.drifting:
            found, covariance = _average_over_size(found, covariance, drift, likely)
        averaged = found.copy()
        averaged[a + state.trends :] -= solution.params[a + state.trends :]  # steps taken before
        state, _ = _renew_slow_changes(problem, _move(problem, state, averaged), (state.slow.kind,))
    left, variance = compute_residuals(problem, state)
    q = _whiten(left, variance + state.excess) ** 2
    turned, steps = None, slice(a + state.trends, a + state.trends + 2 * problem.stations)
    if state.poses is not None:
        assert problem.rot_nb is not None
        in_box = np.swapaxes(problem.rot_nb, 1, 2) @ state.poses.field
        away = np.linalg.norm(state.poses.directions @ state.poses.mount.T - in_box, axis=1)
        turned = 2 * np.arcsin(np.minimum(away / 2, 1.0))
    return StationEstimate(
        coefficients=state.coefficients,
        covariance=covariance[:a, :a],
        residuals=left.squeeze(axis=1) if left.shape[1] == 1 else left,
        weights=np.asarray(loss.weight(q).min(axis=1)),
        excess=state.excess,
        correlation=correlation,
        condition=float(leastsq.condition(covariance[:a, :a])),
        iterations=iterations,
        converged=solution.converged,
        drift=solution.params[drift],
        drift_covariance=solution.covariance[drift, drift],
        ageing=solution.params[ageing],
        ageing_covariance=solution.covariance[ageing, ageing],
        slow=state.slow,
        poses=state.poses,
        fixture_sd=state.fixture_sd,
        turned=turned,
        directions_covariance=None if turned is None else covariance[steps, steps],
    )
