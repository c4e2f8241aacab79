"""What readings, acceleration and rates each add to the joint estimate, attitudes being states.

In level axes whose x points to magnetic north the field is B = F (cos I, 0, sin I) and the force at
rest −g ẑ, always. With the attitude R of the sensor in them, and an error δ of it, R → exp(δ) R:

    reading   raw − bias − W⁻¹ exp(ω τ) Rᵀ B, τ late               in the sensor's axes
    force     ⟨R (force − b_a − ω × v + (1 + S + τ_a ω×) g Rᵀ ẑ)⟩   in the level axes, τ_a late
    rate      Log(R₂ (R₁ D)ᵀ), D what ω turns between two states    in the level axes
    heading   atan2(R₂₁, R₁₁) − heading − offset                     where one is known (`headings`)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.equation.affine import split
from agonic.maths.equation.channels import Problem, field_of_terms
from agonic.maths.estimation.filters.smoother import Sums
from agonic.maths.estimation.loss import tukey
from agonic.maths.estimation.noise.batch_means import FEWEST_BATCHES, measure_correlation
from agonic.maths.estimation.noise.residuals import MAD_TO_SD
from agonic.maths.rotations.attitude import make_rotation
from agonic.maths.rotations.low_pass import low_pass
from agonic.maths.rotations.track import (
    Track,
    find_slips,
    integrate_over_steps,
    lay_track,
    sum_rows,
    sum_slips,
)
from agonic.maths.rotations.vectors import skew
from agonic.units import STANDARD_GRAVITY_M_S2

STEEPEST = 0.25
"""Square of the level part of the axis x below which it has no heading to speak of."""


class Headings(NamedTuple):
    """Headings (n,) beside magnetic north, rad, their standard deviations (n,), infinite where
    there is none, and that of the offset that they share, rad."""

    angle: Array
    sd: Array
    offset_sd: float


def sum_headings(
    headings: Headings, track: Track, attitudes: Array, params: Array
) -> tuple[Sums, float]:
    """The sums of the headings in units of their standard deviations, outliers down-weighted, and
    the variance of white noise that would scatter their sum as much as they do. With attitudes R to
    magnetic north, east and down, the axis x of the sensor has v = R x̂ and the heading ψ =
    atan2(v₂, v₁). An error δ of the state, R → exp(δ) R, moves it by

        δψ = δ₃ − v₃ (v₁ δ₁ + v₂ δ₂)/(v₁² + v₂²).

    What is left lasts for seconds in a filter and for minutes in another, so headings are weighted
    by what batches of them scatter, and never more than they ask for.
    """
    ahead = attitudes[:, :, 0]
    level = ahead[:, 0] ** 2 + ahead[:, 1] ** 2
    rows = np.flatnonzero(np.isfinite(headings.sd) & (level > STEEPEST))
    ahead, sd = ahead[rows], headings.sd[rows]
    offset = headings.offset_sd * params[-1]
    off = np.arctan2(ahead[:, 1], ahead[:, 0]) - headings.angle[rows] - offset
    residuals = np.angle(np.exp(1j * off)) / sd
    usual = float(np.median(np.abs(residuals))) if len(rows) else 0.0
    scale = max(1.0, MAD_TO_SD * usual)
    weights = tukey().weight((residuals / scale) ** 2)
    n = len(rows)
    by_state, by_params = np.zeros((n, 3, 3)), np.zeros((n, 3, len(params)))
    by_state[:, 0, :2] = -ahead[:, 2:] * ahead[:, :2] / level[rows, None]
    by_state[:, 0, 2] = 1.0
    by_state /= sd[:, None, None]
    by_params[:, 0, -1] = -headings.offset_sd / sd
    left = np.stack([residuals, np.zeros(n), np.zeros(n)], axis=1)
    part = track._replace(interval=track.interval[rows], share=track.share[rows])
    return sum_rows(part, left, by_state, by_params, weights), _scatter(weights * residuals)


def _scatter(scores: Array) -> float:
    """The variance of white noise that adds up to as much as the scores (n,), one and more."""
    if len(scores) < FEWEST_BATCHES:
        return 1.0
    white = len(scores) * np.eye(1)
    return measure_correlation(scores[:, None], white)


GRAVITY_SD = 0.003
"""Of gravity from place to place, over the standard one."""
UP_AT_REST = np.array([0.0, 0.0, -STANDARD_GRAVITY_M_S2])
"""The force that is felt at rest, in level axes."""
_ROWS = 16384  # a block whose Jacobian stays small


class Log(NamedTuple):
    """What an inertial unit recorded, in order of time, and how its errors are counted.

    Times (n,), force and rate (n, 3), the rows of its parts without a pause, the standard
    deviations of a row's noise; `sds` (q,) of the shared errors, first those of the unit: bias of
    the accelerometer, bias and scale of the gyro, speed, three each, and the delays of a reading
    and of a force.
    `gains` (g, 3, 3): what one standard deviation of each gain of the accelerometer adds to S.
    `settling_s`: time constant of ⟨⟩, for a vehicle that nods in a gust does not change its course
    at once; 0 without. `headings`: those that do not come from the magnetometer, if any.
    """

    time: Array
    force: Array
    rate: Array
    parts: list[Index]
    force_sd: float
    rate_sd: float
    sds: Array
    gains: Array
    settling_s: float
    headings: Headings | None = None

    @property
    def step_s(self) -> float:
        """From row to row."""
        return float(np.median(np.diff(self.time)))

    @property
    def extra(self) -> int:
        """How many parameters come after those of the problem: gains, and the headings' offset."""
        return len(self.gains) + (self.headings is not None)


class Felt(NamedTuple):
    """Force without the bias found, rate without its errors, the track of the gyro, the speed, the
    delays and the gains found, and where the parameters of the unit and of the gains start among
    all p; `delay_sd` is the unit of that of the readings."""

    force: Array
    rate: Array
    track: Track
    speed: Array
    delay: float
    delay_sd: float
    force_delay: float
    gains: Array
    unit: int
    gain: int
    total: int


def take_out(log: Log, params: Array) -> Felt:
    """What the inertial unit felt, without the errors found."""
    gain = len(params) - log.extra
    unit = gain - len(log.sds)
    errors = params[unit:gain] * log.sds
    rate = (log.rate - errors[3:6]) / (1.0 + errors[6:9])
    track = lay_track(log.time, rate, log.parts)
    force = log.force - errors[:3]
    gains = params[gain : gain + len(log.gains)]
    return Felt(
        force,
        rate,
        track,
        errors[9:12],
        float(errors[12]),
        float(log.sds[12]),
        float(errors[13]),
        gains,
        unit,
        gain,
        len(params),
    )


def sum_readings(
    problem: Problem, felt: Felt, attitudes: Array, params: Array, weights: Array
) -> tuple[Sums, Array, Array]:
    """The sums of the readings, the squares of their residuals (n,), and what of these no turn of
    the attitude makes (n,)."""
    squares, along = np.empty(len(attitudes)), np.empty(len(attitudes))

    def add(rows: slice, track: Track) -> Sums:
        part = problem.subset(rows)
        sides = compare_readings(part, attitudes[rows], felt.rate[rows], params, felt)
        squares[rows] = (sides[0] ** 2).sum(axis=1)
        along[rows] = np.einsum("ni,ni->n", choose_free(sides[1]), sides[0])
        return sum_rows(track, *sides, weights[rows])

    return _by_blocks(felt.track, add), squares, along


def choose_free(by_state: Array) -> Array:
    """The directions (n, 3) of residuals that no turn of the attitude makes, by_state (n, 3, 3)."""
    across = np.cross(by_state, np.roll(by_state, -1, axis=2), axis=1)
    longest = np.argmax((across**2).sum(axis=1), axis=1)
    chosen = np.take_along_axis(across, longest[:, None, None], axis=2)[:, :, 0]
    return np.asarray(chosen / np.sqrt((chosen**2).sum(axis=1, keepdims=True)))


def compare_readings(
    problem: Problem, attitudes: Array, rate: Array, params: Array, felt: Felt
) -> tuple[Array, Array, Array]:
    """Readings against the field a delay ago: residuals (n, 3), by state and params."""
    assert problem.dip is not None
    basis, n = problem.basis, len(attitudes)
    m = basis.shape[1]
    bias, matrix = split(basis @ params[:m])
    inverse = np.linalg.inv(matrix)
    assert problem.shared is not None
    by_dip = problem.shared.dip_by  # by how much each shared error makes the dip steeper, rad
    turn = float(by_dip @ params[felt.gain - len(by_dip) : felt.gain])
    level = problem.dip.horizontal * np.cos(turn) - problem.dip.vertical * np.sin(turn)
    below = problem.dip.vertical * np.cos(turn) + problem.dip.horizontal * np.sin(turn)
    field = np.stack(np.broadcast_arrays(level, 0.0 * level, below, np.zeros(n))[:3], axis=-1)
    ago = make_rotation(felt.delay * rate) @ np.swapaxes(attitudes, 1, 2)
    back = inverse @ ago
    wanted = np.einsum("nij,nj->ni", back, field)
    residuals = problem.points - field_of_terms(problem, params[: felt.gain]) - bias - wanted
    local = np.zeros((n, 3, 12))
    local[:, :, :3] = -np.eye(3)
    local[:, :, 3:] = (inverse[None, :, :, None] * wanted[:, None, None, :]).reshape(n, 3, 9)
    by_params = np.zeros((n, 3, felt.total))
    by_params[:, :, :m] = local @ basis
    later = np.cross(rate, np.einsum("nij,nj->ni", ago, field)) @ inverse.T
    by_params[:, :, felt.unit + 12] = -felt.delay_sd * later
    if problem.terms is not None:
        k = problem.terms.shape[1]
        each = -np.eye(3)[None, :, :, None] * problem.terms[:, None, None, :]
        by_params[:, :, m : m + 3 * k] = each.reshape(n, 3, 3 * k)
    if by_dip.any():
        steeper = np.stack([-field[:, 2], 0.0 * field[:, 0], field[:, 0]], axis=1)
        moved = -np.einsum("nij,nj->ni", back, steeper)
        by_params[:, :, felt.unit : felt.gain] += moved[:, :, None] * by_dip
    return residuals, -back @ skew(field), by_params


def sum_force(log: Log, felt: Felt, attitudes: Array) -> Sums:
    """The sums of the acceleration. It is smoothed, ⟨⟩: fast attitude is the gyro's to tell. What a
    gain stretches is the force that should be there: stretching the one that was read would make
    its noise the smaller the larger the gain."""
    level, axes, turning, late, stretched = steady_force(log, felt, attitudes)

    def add(rows: slice, track: Track) -> Sums:
        n = len(track.interval)
        by_params = np.zeros((n, 3, felt.total))
        first = felt.unit
        by_params[:, :, first : first + 3] = -axes[rows] * log.sds[:3]
        by_params[:, :, first + 9 : first + 12] = -turning[rows] * log.sds[9:12]
        by_params[:, :, first + 13] = -late[rows] * log.sds[13]
        by_params[:, :, felt.gain : felt.gain + len(log.gains)] = -stretched[rows]
        by_state = np.broadcast_to(-skew(UP_AT_REST), (n, 3, 3))
        return sum_rows(track, level[rows] - UP_AT_REST, by_state, by_params, np.ones(n))

    return _by_blocks(felt.track, add)


def steady_force(log: Log, felt: Felt, attitudes: Array) -> tuple[Array, ...]:
    """The force in the level axes without the shares of speed, delay and gain, and what a bias, a
    speed, a delay and the gains are felt as there: (n, 3), twice (n, 3, 3), (n, 3) and (n, 3, g),
    all smoothed."""
    n, g = len(attitudes), len(log.gains)
    rest = attitudes[:, 2] * UP_AT_REST[2]
    level = np.einsum("nij,nj->ni", attitudes, felt.force)
    stretched = attitudes @ np.einsum("gij,nj->nig", log.gains, rest)
    late = np.einsum("nij,nj->ni", attitudes, np.cross(felt.rate, rest))
    columns = [attitudes, attitudes @ skew(felt.rate), late, stretched]
    whole = np.concatenate([level, *(one.reshape(n, -1) for one in columns)], axis=1)
    for rows in log.parts:
        if len(rows) > 3 and log.settling_s > 0.0:
            step = float(np.median(np.diff(log.time[rows])))
            whole[rows] = low_pass(whole[rows], step, log.settling_s)
    level, axes, turning, late, stretched = np.split(whole, [3, 12, 21, 24], axis=1)
    turning, stretched = turning.reshape(n, 3, 3), stretched.reshape(n, 3, g)
    level = level - turning @ felt.speed - late * felt.force_delay - stretched @ felt.gains
    return level, axes.reshape(n, 3, 3), turning, late, stretched


def sum_rate(
    log: Log, felt: Felt, states: Array, attitudes: Array, counts: Array
) -> tuple[Sums, Array]:
    """The sums of the rates, whose errors turn D by ∫ R δω dt, in units of a row's noise; and the
    squares of what is left of each turn, as `sum_slips` has them. What a scale stretches is the
    rate at which the states turn, for the noise of the gyro's own would go together with the
    residuals."""
    track, slips = felt.track, find_slips(felt.track, states)
    span = np.maximum(np.diff(log.time[track.nodes]), 1e-9)
    more = np.concatenate([slips / span[:, None], np.zeros((1, 3))])[track.interval]
    rate = felt.rate + np.einsum("nji,nj->ni", attitudes, more)
    by_errors = np.concatenate([attitudes, attitudes * rate[:, None, :]], axis=2)
    by_params = np.zeros((len(states) - 1, 3, felt.total))
    turned = integrate_over_steps(track, by_errors, log.time, log.parts)
    by_params[:, :, felt.unit + 3 : felt.unit + 9] = turned * log.sds[3:9]
    sums, squares = sum_slips(track, slips, by_params, log.time, counts)
    return sums.scale(1.0 / log.step_s), squares / log.step_s


def _by_blocks(track: Track, add: Callable[[slice, Track], Sums]) -> Sums:
    """The sums over all rows, a block after the other."""
    total: Sums | None = None
    for start in range(0, len(track.interval), _ROWS):
        rows = slice(start, start + _ROWS)
        part = track._replace(interval=track.interval[rows], share=track.share[rows])
        one = add(rows, part)
        total = one if total is None else total.add(one)
    assert total is not None
    return total
