"""The prior of a sensor at turned stations, for the solver: soft iron, drift, fixture."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.maths.equation import temperature_model
from agonic.maths.estimation import leastsq
from agonic.maths.rotations.vectors import skew
from agonic.thermal.maths import stations
from agonic.thermal.maths.station_residuals import Poses, State, StationProblem


def make_prior(problem: StationProblem, state: State) -> leastsq.Prior:
    """Prior on soft iron, drift, and the fixture where orientations are known, at a state."""
    if state.poses is None:
        return _make_common_prior(problem, state, 0)
    return _make_fixture_prior(problem, state, state.poses)


def _make_common_prior(problem: StationProblem, state: State, more: int) -> leastsq.Prior:
    """The prior on soft iron, and on drift and ageing, which may be as large as the field, for
    parameters with `more` others last.
    """
    width = state.trends
    rows = temperature_model.weak_prior(problem.gauge, problem.degree, problem.soft_iron_sd)
    a = problem.layout.shape[1]
    jacobian = np.zeros((len(rows) + width, a + width + more))
    jacobian[: len(rows), : rows.shape[1]] = rows
    jacobian[len(rows) :, a : a + width] = np.eye(width)

    def prior(params: Array) -> tuple[Array, Array]:
        return jacobian @ params, jacobian

    return prior


def _make_fixture_prior(problem: StationProblem, state: State, poses: Poses) -> leastsq.Prior:
    """That, and that each station stands as described, to the standard deviation of the state.

    Tangential parts of M p_k − R_kᵀ f, over their standard deviation.
    """
    k, width = problem.stations, state.trends
    soft = _make_common_prior(problem, state, 2 * k + 5)
    seen_tangent = stations.find_tangents(poses.directions)
    field_tangent = stations.find_tangents(poses.field)
    assert problem.rot_nb is not None
    back = np.swapaxes(problem.rot_nb, 1, 2)
    across = stations.find_tangents(back @ poses.field)
    first = problem.layout.shape[1] + width

    def prior(params: Array) -> tuple[Array, Array]:
        base, by = soft(params)
        steps = params[first : first + 2 * k].reshape(k, 2)
        turn, tilt = params[first + 2 * k : first + 2 * k + 3], params[first + 2 * k + 3 :]
        seen, sway = stations.move_on_sphere(poses.directions, seen_tangent, steps)
        field, lean = stations.move_on_sphere(poses.field, field_tangent, tilt)
        in_box = seen @ poses.mount.T
        small = np.eye(3) + skew(turn)
        r = in_box @ small.T - back @ field
        jacobian = np.zeros((k, 3, len(params)))
        moved = small @ poses.mount @ sway
        for station in range(k):
            at = first + 2 * station
            jacobian[station, :, at : at + 2] = moved[station]
            jacobian[station, :, first + 2 * k : first + 2 * k + 3] = -skew(in_box[station])
        jacobian[:, :, first + 2 * k + 3 :] = -back @ lean
        flat = np.swapaxes(across, 1, 2)
        z = np.einsum("kij,kj->ki", flat, r).ravel() / state.fixture_sd
        rows = (flat @ jacobian).reshape(2 * k, -1) / state.fixture_sd
        return np.concatenate([base, z]), np.concatenate([by, rows])

    return prior


def step_poses(poses: Poses, steps: Array, k: int) -> Poses:
    """The poses after the small steps that the solver found."""
    seen, _ = stations.move_on_sphere(
        poses.directions, stations.find_tangents(poses.directions), steps[: 2 * k].reshape(k, 2)
    )
    field, _ = stations.move_on_sphere(
        poses.field, stations.find_tangents(poses.field), steps[2 * k + 3 :]
    )
    u, _, vt = np.linalg.svd((np.eye(3) + skew(steps[2 * k : 2 * k + 3])) @ poses.mount)
    return Poses(seen, u @ vt, field)


def estimate_width(solution: leastsq.Solution, z: Array, rows: Array, own: slice) -> float:
    """By what the width of a part of the prior should be multiplied, for it to fit its residuals.

    MacKay's (1992) update of a prior's width, s² ← Σz²/γ with γ the effective number of parameters
    that the readings determine, repeated on the linearised problem until it stands.
    """
    rest = np.ones(len(z), dtype=bool)
    rest[own] = False
    others, count = np.flatnonzero(rest), own.stop - own.start
    gradient = -(z @ rows)  # of the readings: at the minimum the prior balances it
    fixed = solution.information + rows[others].T @ rows[others]
    pull, scale = rows[own].T @ rows[own], 1.0
    for _ in range(30):
        covariance = leastsq.inverse(fixed + pull / scale**2)
        step = -covariance @ (gradient + z[others] @ rows[others] + z[own] @ rows[own] / scale**2)
        left = z[own] + rows[own] @ step
        free = count - float(np.trace(covariance @ pull)) / scale**2
        before, scale = scale, max(float(np.sqrt(left @ left / max(free, 1.0))), 1e-6)
        if abs(scale / before - 1) < 1e-3:
            break
    return scale
