"""The readings of turned stations as residuals for the solver, with their Jacobians.

A sensor with W(φ) and b(φ) is turned from station to station in a field of magnitude one. With the
magnitude alone, unknown beside the coefficients is only how the field changed, and how the bias
aged; with orientations, also its direction at each station (two small steps), the mounting of the
sensor in the box (three), and the direction of the field in the chamber (two). Points are centred
and scaled to about one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.equation import temperature_model
from agonic.maths.equation.affine import SYMMETRIC
from agonic.maths.estimation import leastsq
from agonic.maths.rotations.vectors import find_smallest_rotation
from agonic.thermal.maths import gaussian_process, stations

ANY_TURN = float(np.pi)
"""The standard deviation of an orientation of which nothing is known before, rad."""


class StationProblem(NamedTuple):
    """The means of cells: `points` (m, 3), `covariance` (m, 3, 3) of each, `phi` (m, q), `station`
    (m,) 0…k−1; `pace` (m,) the time as −½…½ where the field may drift, or None; `course` the times,
    where it may change slowly, or None; the drift is averaged over being there or not unless it is
    `drifting` for sure.

    `degree`, `gauge` and `rate` make the layout; `soft_iron_sd` is the prior of what the stations
    leave open; `rot_nb` (k, 3, 3) the described orientations, or None, and `fixture_sd` how well
    they are known at first, rad; `fixture_known` keeps that prior whatever the readings say.
    """

    points: Array
    covariance: Array
    phi: Array
    station: Index
    pace: Array | None
    degree: int
    course: gaussian_process.TimeBasis | None = None
    drifting: bool = False
    gauge: str = SYMMETRIC
    rate: bool = False
    soft_iron_sd: float = 0.1
    rot_nb: Array | None = None
    fixture_sd: float = 0.0175
    fixture_known: bool = False

    @property
    def turns_known(self) -> bool:
        """Whether orientations were described, and not found from the readings themselves."""
        return self.rot_nb is not None and self.fixture_sd < ANY_TURN

    def with_found_turns(self, seen: Array) -> StationProblem:
        """With the turns that the directions (k, 3) of the field at the stations show.

        Those about the field itself no magnetometer sees, and no calibration needs: a direction is
        the same at all temperatures, and anything else is left to it.
        """
        turns = find_smallest_rotation(seen, np.broadcast_to(seen[0], seen.shape))
        return self._replace(rot_nb=turns, fixture_sd=ANY_TURN, fixture_known=True)

    @property
    def layout(self) -> Array:
        """From the coefficients to the local numbers."""
        return temperature_model.build_layout(self.degree, self.gauge, self.rate)

    @property
    def stations(self) -> int:
        """How many stations there are."""
        return int(self.station.max()) + 1

    @property
    def clock(self) -> Array:
        """What the field may have followed over the whole campaign, (m, 0) or (m, 1)."""
        return np.zeros((len(self.points), 0)) if self.pace is None else self.pace[:, None]


class Poses(NamedTuple):
    """Directions of the field seen at the stations (k, 3), mounting (3, 3), field (3,)."""

    directions: Array
    mount: Array
    field: Array


class State(NamedTuple):
    """What is fixed while the solver runs, and renewed after."""

    coefficients: Array
    drift: Array  # (d,) along the field or (3d,) in the chamber's axes
    ageing: Array  # (0,) or (3,) of the bias, in the axes of the sensor
    poses: Poses | None
    excess: float
    fixture_sd: float
    slow: gaussian_process.GaussianProcess
    followed: Array  # (m, 1) or (m, 3) as the drift: the slow changes at each mean

    @property
    def trends(self) -> int:
        """How many numbers say what changed steadily over the campaign."""
        return len(self.drift) + len(self.ageing)


def _evaluate(problem: StationProblem, coefficients: Array, ageing: Array) -> tuple[Array, Array]:
    """Bias (m, 3) and matrix (m, 3, 3) at each mean."""
    bias, matrix = temperature_model.evaluate_local(coefficients, problem.layout, problem.phi)
    return (bias + problem.clock * ageing if len(ageing) else bias), matrix


def find_directions(problem: StationProblem, coefficients: Array) -> Array:
    """The mean direction (k, 3) of the corrected field at each station."""
    bias, matrix = temperature_model.evaluate_local(coefficients, problem.layout, problem.phi)
    u = np.einsum("mij,mj->mi", matrix, problem.points - bias)
    total = np.zeros((problem.stations, 3))
    np.add.at(total, problem.station, u)
    return np.asarray(total / np.linalg.norm(total, axis=1, keepdims=True))


def find_feet(problem: StationProblem, state: State) -> Array:
    """The readings (m, 3) of each mean as they would be without noise. Columns of faults are taken
    there: at the means they hold the noise itself, which then looks like steps of the bias across
    the field."""
    coefficients, poses = state.coefficients, state.poses
    bias, matrix = temperature_model.evaluate_local(coefficients, problem.layout, problem.phi)
    seen = find_directions(problem, coefficients) if poses is None else poses.directions
    return np.asarray(bias + np.linalg.solve(matrix, seen[problem.station][..., None])[..., 0])


def collect_parameters(state: State, a: int) -> Array:
    """The parameters that the solver moves, at the state: small steps of the poses are zero."""
    parts = [state.coefficients, state.drift, state.ageing]
    if state.poses is not None:
        parts.append(np.zeros(2 * len(state.poses.directions) + 5))
    return np.concatenate(parts)


def compute_residuals(problem: StationProblem, state: State) -> tuple[Array, Array]:
    """Residuals as they are, (m, 1) or (m, 3), and the variance of the noise in each."""
    bias, matrix = _evaluate(problem, state.coefficients, state.ageing)
    if state.poses is None:
        unit, spread = _find_directions_and_variance(problem, bias, matrix)
        changed = problem.clock @ state.drift + state.followed[:, 0]
        wanted = _expect_magnitude(problem, matrix, unit) + changed
        r, _ = _compute_log_residual(problem, bias, matrix, wanted)
        s = np.einsum("mji,mj->mi", matrix, unit)
        gain = np.einsum("mi,mi->m", s, s)
        return (r / np.sqrt(gain))[:, None], (spread / gain)[:, None]
    field = state.poses.directions[problem.station] + _change_field(problem, state, state.poses)
    r, _, _ = temperature_model.reading_residual(problem.points, bias, matrix, field)
    return r, np.einsum("mii->mi", problem.covariance)


def _find_directions_and_variance(
    problem: StationProblem, bias: Array, matrix: Array
) -> tuple[Array, Array]:
    """Unit directions (m, 3) of the corrected means, and the variance of their magnitude (m,)."""
    u = np.einsum("mij,mj->mi", matrix, problem.points - bias)
    unit = u / np.linalg.norm(u, axis=1, keepdims=True)
    s = np.einsum("mji,mj->mi", matrix, unit)
    return unit, np.einsum("mi,mij,mj->m", s, problem.covariance, s)


def _expect_magnitude(problem: StationProblem, matrix: Array, unit: Array) -> Array:
    """The magnitude to expect of each mean, for its logarithm: noise across lengthens a vector by
    its variance, tr/2, and noise along shortens the mean of the logarithm by half of its own.
    """
    spread = np.einsum("mij,mjk,mik->m", matrix, problem.covariance, matrix)
    along = np.einsum("mi,mij,mjk,mlk,ml->m", unit, matrix, problem.covariance, matrix, unit)
    return np.asarray(1.0 + (spread - 2 * along) / 2)


def _compute_log_residual(
    problem: StationProblem, bias: Array, matrix: Array, wanted: Array
) -> tuple[Array, Array]:
    """ln(|W (raw − b)|/wanted), (m,), and its Jacobian by the local numbers.

    The logarithm, for its derivative by the gain is free of noise. That of the magnitude itself
    holds the noise, and where slow changes leave the gain open that noise would shrink it.
    """
    none = np.zeros(len(wanted))
    size, jacobian = temperature_model.size_residual(problem.points, bias, matrix, none)
    return np.log(size / wanted), jacobian / size[:, None]


def _change_field(problem: StationProblem, state: State, poses: Poses) -> Array:
    """What the chamber's field had changed by at each mean, in the axes of the sensor, (m, 3)."""
    axes, clock = list_drift_axes(problem, poses), problem.clock
    drift = clock @ state.drift.reshape(clock.shape[1], len(axes))
    changed = drift @ axes + state.followed
    return np.asarray(np.einsum("mij,mj->mi", _rotate_to_sensor(problem, poses), changed))


def list_drift_axes(problem: StationProblem, poses: Poses) -> Array:
    """The directions (d, 3) in which the field may drift: along itself where turns about it are not
    known."""
    return np.eye(3) if problem.turns_known else poses.field[None]


def _rotate_to_sensor(problem: StationProblem, poses: Poses) -> Array:
    """From the chamber's axes to the sensor's at each mean, (m, 3, 3).

    As described, and then by the shortest way to the direction in which the field was seen: with a
    station 1° off, a drift of 1000 nT would otherwise be off by 17 nT along the field.
    """
    assert problem.rot_nb is not None
    described = np.einsum("ji,mkj->mik", poses.mount, problem.rot_nb)
    shortest = find_smallest_rotation(described @ poses.field, poses.directions)
    return np.asarray((shortest @ described)[problem.station])


def project_changes(problem: StationProblem, state: State) -> gaussian_process.StationSpaces:
    """What slow changes of the field look like in the whitened residuals of each station."""
    assert problem.course is not None
    bias, matrix = _evaluate(problem, state.coefficients, state.ageing)
    if state.poses is None:
        by_field = -_weigh_magnitudes(problem, state, bias, matrix)[:, None, None]
    else:
        by_field = -_make_noise_whitener(problem, state) @ np.linalg.inv(matrix)
        by_field = by_field @ _rotate_to_sensor(problem, state.poses)
    return gaussian_process.project_on_stations(by_field, problem.course, problem.station)


def make_whitener(problem: StationProblem, state: State) -> Callable[[Array], Array]:
    """What whitens residuals and Jacobians with the slow changes of the state."""
    if state.slow.sd == 0.0:
        return lambda values: values
    of = project_changes(problem, state)
    axes = gaussian_process.find_principal_axes(of, state.slow.kind)
    return lambda values: gaussian_process.whiten(of, state.slow.sd, axes, values)


def _weigh_magnitudes(problem: StationProblem, state: State, bias: Array, matrix: Array) -> Array:
    """One over the standard deviation of each mean's magnitude, (m,)."""
    unit, spread = _find_directions_and_variance(problem, bias, matrix)
    s = np.einsum("mji,mj->mi", matrix, unit)
    return np.asarray(1 / np.sqrt(spread + state.excess * np.einsum("mi,mi->m", s, s)))


def _make_noise_whitener(problem: StationProblem, state: State) -> Array:
    """What makes the noise of each mean white, (m, 3, 3)."""
    return np.linalg.inv(np.linalg.cholesky(problem.covariance + state.excess * np.eye(3)))


def make_pieces(problem: StationProblem, state: State) -> leastsq.Pieces:
    """Residuals for the solver at a state."""
    if state.poses is None:
        return _make_magnitude_pieces(problem, state)
    return _make_vector_pieces(problem, state, state.poses)


def _make_magnitude_pieces(problem: StationProblem, state: State) -> leastsq.Pieces:
    """Residuals of the magnitude over their standard deviations at the state."""
    onto = problem.layout
    a, width = onto.shape[1], len(state.drift)
    bias, matrix = _evaluate(problem, state.coefficients, state.ageing)
    unit, _ = _find_directions_and_variance(problem, bias, matrix)
    weight, clock = _weigh_magnitudes(problem, state, bias, matrix), problem.clock
    calmed = make_whitener(problem, state)
    wanted = _expect_magnitude(problem, matrix, unit)

    def blocks(params: Array) -> Iterator[tuple[Array, Array]]:
        bias, matrix = _evaluate(problem, params[:a], params[a + width :])
        expected = wanted + clock @ params[a : a + width]
        r, jacobian = _compute_log_residual(problem, bias, matrix, expected)
        by = temperature_model.chain_to_coefficients(jacobian, onto, problem.phi)
        aged = clock * jacobian[:, : len(state.ageing)]
        rows = np.concatenate([by, -clock / expected[:, None], aged], axis=1) * weight[:, None]
        yield calmed(r * weight), calmed(rows)

    return blocks


def _make_vector_pieces(problem: StationProblem, state: State, poses: Poses) -> leastsq.Pieces:
    """Residuals of the readings, whitened; an axis after the other, each in the order of cells."""
    onto, k = problem.layout, problem.stations
    a, width, after = onto.shape[1], len(state.drift), onto.shape[1] + state.trends
    m, tangent = len(problem.points), stations.find_tangents(poses.directions)
    white = _make_noise_whitener(problem, state)
    calmed = make_whitener(problem, state)
    turning, clock = _rotate_to_sensor(problem, poses), problem.clock
    drifting = list_drift_axes(problem, poses)
    places = np.arange(m)

    def blocks(params: Array) -> Iterator[tuple[Array, Array]]:
        bias, matrix = _evaluate(problem, params[:a], params[a + width : after])
        steps = params[after : after + 2 * k].reshape(k, 2)
        seen, sway = stations.move_on_sphere(poses.directions, tangent, steps)
        field = seen[problem.station]
        changed = clock @ params[a : a + width].reshape(clock.shape[1], len(drifting)) @ drifting
        field = field + np.einsum("mij,mj->mi", turning, changed)
        r, by_local, inverse = temperature_model.reading_residual(
            problem.points, bias, matrix, field
        )
        jacobian = np.zeros((m, 3, len(params)))
        jacobian[:, :, :a] = temperature_model.chain_to_coefficients(
            by_local, onto, problem.phi[:, None]
        )
        by_field = -inverse @ turning @ drifting.T
        jacobian[:, :, a : a + width] = np.einsum("mij,md->midj", by_field, clock).reshape(
            m, 3, width
        )
        if len(state.ageing):
            jacobian[:, :, a + width : after] = clock[:, None] * by_local[:, :, :3]
        swayed = -inverse @ sway[problem.station]
        for j in range(2):
            jacobian[places, :, after + 2 * problem.station + j] = swayed[:, :, j]
        z = np.einsum("mij,mj->im", white, r).ravel()
        rows = np.einsum("mij,mjp->imp", white, jacobian).reshape(3 * m, -1)
        yield calmed(z), calmed(rows)

    return blocks
