"""The readings of turned stations as residuals and beliefs for the solver, with their Jacobians.

A sensor with W(φ) and b(φ) is turned from station to station in a field of magnitude one. Taught by
the magnitude, unknown beside the coefficients is only how the field changed; taught by the turns,
also its direction at each station (two small steps), the mounting of the sensor in the box (three),
and the direction of the field in the chamber (two). Points are centred and scaled to about one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.kernels import fixture, leastsq, thermal
from agonic.kernels.affine import SYMMETRIC

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class Problem(NamedTuple):
    """The means of cells: `points` (m, 3), `covariance` (m, 3, 3) of each, `phi` (m, q), `station`
    (m,) 0…k−1; `pace` (m,) the time as −½…½ where the field may drift, or None; `slow` (m, s) the
    time within the station as functions that its field may have followed, or None, which are part
    of the model where it is `changing`.

    `degree`, `gauge` and `rate` make the layout; `soft_iron_sd` the prior that holds what the
    stations leave open; `rot_nb` (k, 3, 3) the described turns, or None, and `fixture_sd` how well
    they are believed at first, rad; `fixture_known` keeps that belief whatever the readings say.
    """

    points: Array
    covariance: Array
    phi: Array
    station: Index
    pace: Array | None
    degree: int
    slow: Array | None = None
    changing: bool = False
    gauge: str = SYMMETRIC
    rate: bool = False
    soft_iron_sd: float = 0.1
    rot_nb: Array | None = None
    fixture_sd: float = 0.0175
    fixture_known: bool = False

    @property
    def layout(self) -> Array:
        """From the coefficients to the local numbers."""
        return thermal.layout(self.degree, self.gauge, self.rate)

    @property
    def stations(self) -> int:
        """How many stations there are."""
        return int(self.station.max()) + 1

    @property
    def own(self) -> Array:
        """The functions that the field of each station may have followed, (m, k·s)."""
        assert self.slow is not None
        m, s = self.slow.shape
        own = np.zeros((m, self.stations, s))
        own[np.arange(m), self.station] = self.slow
        return own.reshape(m, -1)

    @property
    def clock(self) -> Array:
        """What the field may have followed (m, d): the drift, then what each station may have."""
        m = len(self.points)
        parts = [np.zeros((m, 0)) if self.pace is None else self.pace[:, None]]
        if self.changing:
            parts.append(self.own)
        return np.concatenate(parts, axis=1)


class Poses(NamedTuple):
    """Directions of the field seen at the stations (k, 3), mounting (3, 3), field (3,)."""

    directions: Array
    mount: Array
    field: Array


class State(NamedTuple):
    """What is held while the solver runs, and renewed after."""

    coefficients: Array
    drift: Array  # (d, 1) along the field or (d, 3) in the chamber's axes, one after the other
    poses: Poses | None
    excess: float
    fixture_sd: float
    slow_sd: float


def directions(problem: Problem, coefficients: Array) -> Array:
    """The mean direction (k, 3) of the corrected field at each station."""
    bias, matrix = thermal.local(coefficients, problem.layout, problem.phi)
    u = np.einsum("mij,mj->mi", matrix, problem.points - bias)
    total = np.zeros((problem.stations, 3))
    np.add.at(total, problem.station, u)
    return np.asarray(total / np.linalg.norm(total, axis=1, keepdims=True))


def parameters(state: State, a: int) -> Array:
    """The parameters that the solver moves, at the state: small steps of the poses are zero."""
    parts = [state.coefficients, state.drift]
    if state.poses is not None:
        parts.append(np.zeros(2 * len(state.poses.directions) + 5))
    return np.concatenate(parts)


def steady(problem: Problem, state: State) -> int:
    """How many of the changes of the field are its steady drift."""
    return 0 if problem.pace is None else 1 if state.poses is None else 3


def residuals(problem: Problem, state: State) -> tuple[Array, Array]:
    """Residuals as they are, (m, 1) or (m, 3), and the variance of the noise in each."""
    bias, matrix = thermal.local(state.coefficients, problem.layout, problem.phi)
    if state.poses is None:
        unit, spread = _across(problem, bias, matrix)
        wanted = _wanted(problem, state, matrix, unit)
        r, _ = thermal.size_residual(problem.points, bias, matrix, wanted)
        s = np.einsum("mji,mj->mi", matrix, unit)
        gain = np.einsum("mi,mi->m", s, s)
        return (r / np.sqrt(gain))[:, None], (spread / gain)[:, None]
    field = state.poses.directions[problem.station] + _drifted(problem, state, state.poses)
    r, _, _ = thermal.reading_residual(problem.points, bias, matrix, field)
    return r, np.einsum("mii->mi", problem.covariance)


def _across(problem: Problem, bias: Array, matrix: Array) -> tuple[Array, Array]:
    """Unit directions (m, 3) of the corrected means, and the variance of their magnitude (m,)."""
    u = np.einsum("mij,mj->mi", matrix, problem.points - bias)
    unit = u / np.linalg.norm(u, axis=1, keepdims=True)
    s = np.einsum("mji,mj->mi", matrix, unit)
    return unit, np.einsum("mi,mij,mj->m", s, problem.covariance, s)


def _wanted(problem: Problem, state: State, matrix: Array, unit: Array) -> Array:
    """The magnitude to expect of each mean: noise lengthens a vector by its part across, tr/2."""
    spread = np.einsum("mij,mjk,mik->m", matrix, problem.covariance, matrix)
    along = np.einsum("mi,mij,mjk,mlk,ml->m", unit, matrix, problem.covariance, matrix, unit)
    wanted = 1.0 + (spread - along) / 2
    return np.asarray(wanted + problem.clock @ state.drift)


def _drifted(problem: Problem, state: State, poses: Poses) -> Array:
    """What the chamber's field had changed by at each mean, in the axes of the sensor, (m, 3)."""
    changed = problem.clock @ state.drift.reshape(-1, 3)
    return np.asarray(np.einsum("mij,mj->mi", _to_sensor(problem, poses), changed))


def _to_sensor(problem: Problem, poses: Poses) -> Array:
    """From the chamber's axes to the sensor's at each mean, (m, 3, 3)."""
    assert problem.rot_nb is not None
    return np.asarray(np.einsum("ji,mkj->mik", poses.mount, problem.rot_nb[problem.station]))


def posed(problem: Problem, state: State) -> tuple[leastsq.Pieces, leastsq.Prior]:
    """Residuals and beliefs for the solver at a state."""
    if state.poses is None:
        return _size_pieces(problem, state), _belief(problem, state, 0)
    return _vector_pieces(problem, state, state.poses), _fixture_belief(problem, state, state.poses)


def _size_pieces(problem: Problem, state: State) -> leastsq.Pieces:
    """Residuals of the magnitude over their standard deviations at the state."""
    onto = problem.layout
    a = onto.shape[1]
    bias, matrix = thermal.local(state.coefficients, onto, problem.phi)
    unit, spread = _across(problem, bias, matrix)
    s = np.einsum("mji,mj->mi", matrix, unit)
    weight = 1 / np.sqrt(spread + state.excess * np.einsum("mi,mi->m", s, s))
    clock = problem.clock
    still = state._replace(drift=np.zeros(clock.shape[1]))
    wanted = _wanted(problem, still, matrix, unit)

    def blocks(params: Array) -> Iterator[tuple[Array, Array]]:
        bias, matrix = thermal.local(params[:a], onto, problem.phi)
        expected = wanted + clock @ params[a:]
        r, jacobian = thermal.size_residual(problem.points, bias, matrix, expected)
        by = thermal.by_coefficients(jacobian, onto, problem.phi)
        yield r * weight, np.concatenate([by, -clock], axis=1) * weight[:, None]

    return blocks


def _vector_pieces(problem: Problem, state: State, poses: Poses) -> leastsq.Pieces:
    """Residuals of the readings, whitened; an axis after the other, each in the order of cells."""
    onto, k = problem.layout, problem.stations
    a, width = onto.shape[1], len(state.drift)
    m, tangent = len(problem.points), fixture.tangents(poses.directions)
    white = np.linalg.inv(np.linalg.cholesky(problem.covariance + state.excess * np.eye(3)))
    turning, clock = _to_sensor(problem, poses), problem.clock
    places = np.arange(m)

    def blocks(params: Array) -> Iterator[tuple[Array, Array]]:
        bias, matrix = thermal.local(params[:a], onto, problem.phi)
        steps = params[a + width : a + width + 2 * k].reshape(k, 2)
        seen, sway = fixture.moved(poses.directions, tangent, steps)
        field = seen[problem.station]
        changed = clock @ params[a : a + width].reshape(-1, 3)
        field = field + np.einsum("mij,mj->mi", turning, changed)
        r, by_local, inverse = thermal.reading_residual(problem.points, bias, matrix, field)
        jacobian = np.zeros((m, 3, len(params)))
        phi = np.repeat(problem.phi, 3, axis=0)
        jacobian[:, :, :a] = thermal.by_coefficients(by_local.reshape(-1, 12), onto, phi).reshape(
            m, 3, a
        )
        by_field = -inverse @ turning
        jacobian[:, :, a : a + width] = np.einsum("mij,md->midj", by_field, clock).reshape(
            m, 3, width
        )
        swayed = -inverse @ sway[problem.station]
        for j in range(2):
            jacobian[places, :, a + width + 2 * problem.station + j] = swayed[:, :, j]
        z = np.einsum("mij,mj->im", white, r).ravel()
        yield z, np.einsum("mij,mjp->imp", white, jacobian).reshape(3 * m, -1)

    return blocks


def _belief(problem: Problem, state: State, more: int) -> leastsq.Prior:
    """The prior on soft iron and on changes of the field, for parameters with `more` others last.

    The steady drift may be as large as the field; slow changes are as large as believed now.
    """
    width = len(state.drift)
    rows = thermal.belief(problem.gauge, problem.degree, problem.soft_iron_sd)
    a = problem.layout.shape[1]
    jacobian = np.zeros((len(rows) + width, a + width + more))
    jacobian[: len(rows), : rows.shape[1]] = rows
    sd = np.full(width, state.slow_sd)
    sd[: steady(problem, state)] = 1.0
    jacobian[len(rows) :, a : a + width] = np.diag(1 / sd)

    def prior(params: Array) -> tuple[Array, Array]:
        return jacobian @ params, jacobian

    return prior


def _fixture_belief(problem: Problem, state: State, poses: Poses) -> leastsq.Prior:
    """That, and that each station stands as described, to the standard deviation believed now.

    Tangential parts of M p_k − R_kᵀ f, over their standard deviation.
    """
    k, width = problem.stations, len(state.drift)
    soft = _belief(problem, state, 2 * k + 5)
    seen_tangent = fixture.tangents(poses.directions)
    field_tangent = fixture.tangents(poses.field)
    assert problem.rot_nb is not None
    back = np.swapaxes(problem.rot_nb, 1, 2)
    across = fixture.tangents(back @ poses.field)
    first = problem.layout.shape[1] + width

    def prior(params: Array) -> tuple[Array, Array]:
        base, by = soft(params)
        steps = params[first : first + 2 * k].reshape(k, 2)
        turn, shift = params[first + 2 * k : first + 2 * k + 3], params[first + 2 * k + 3 :]
        seen, sway = fixture.moved(poses.directions, seen_tangent, steps)
        field, lean = fixture.moved(poses.field, field_tangent, shift)
        in_box = seen @ poses.mount.T
        small = np.eye(3) + _cross(turn)
        r = in_box @ small.T - back @ field
        jacobian = np.zeros((k, 3, len(params)))
        moved = small @ poses.mount @ sway
        for station in range(k):
            at = first + 2 * station
            jacobian[station, :, at : at + 2] = moved[station]
            jacobian[station, :, first + 2 * k : first + 2 * k + 3] = -_cross(in_box[station])
        jacobian[:, :, first + 2 * k + 3 :] = -back @ lean
        flat = np.swapaxes(across, 1, 2)
        z = np.einsum("kij,kj->ki", flat, r).ravel() / state.fixture_sd
        rows = (flat @ jacobian).reshape(2 * k, -1) / state.fixture_sd
        return np.concatenate([base, z]), np.concatenate([by, rows])

    return prior


def _cross(v: Array) -> Array:
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def stepped(poses: Poses, steps: Array, k: int) -> Poses:
    """The poses after the small steps that the solver found."""
    seen, _ = fixture.moved(
        poses.directions, fixture.tangents(poses.directions), steps[: 2 * k].reshape(k, 2)
    )
    field, _ = fixture.moved(poses.field, fixture.tangents(poses.field), steps[2 * k + 3 :])
    u, _, vt = np.linalg.svd((np.eye(3) + _cross(steps[2 * k : 2 * k + 3])) @ poses.mount)
    return Poses(seen, u @ vt, field)
