"""A step of the joint estimate, how noisy readings, force and rates are by what it leaves of each,
and its covariance where what is left of readings lasts in time.

A step is one of Gauss and Newton on parameters and attitudes, the attitudes eliminated.

The attitudes follow the parameters by X = ∂x/∂θ, so a reading depends on these by J + J_x X. Errors
that last in the axes of the sensor scatter the gradient as products of residuals show them
(`noise_with_memory`): a bias takes up all of them, a matrix only what turns with the field. Seen
are residuals along the field alone, for those across it the free attitude takes up. Where these
show nothing, sums of all scores over longer times tell by how much the whole scatters more.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.inertial.maths.factors import (
    UP_AT_REST,
    Felt,
    Log,
    choose_free,
    compare_readings,
    steady_force,
)
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import MIN_INFORMATION
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.filters.block_tridiagonal import Tridiagonal, invert
from agonic.maths.estimation.filters.smoother import Sums, eliminate
from agonic.maths.estimation.loss import cauchy
from agonic.maths.estimation.noise.batch_means import measure_correlation
from agonic.maths.estimation.noise.noise_with_memory import (
    STRETCHES,
    Stretches,
    find_memory,
    sum_scatter,
)
from agonic.maths.rotations.low_pass import find_passed
from agonic.units import STANDARD_GRAVITY_M_S2

_FAR = 0.05  # rad: the square of a turn is no longer small
_FARTHEST = 1e3  # of the size of a parameter
_LOOSE = 1e-6  # what is known of a state beforehand, over 1/rad²


class Step(NamedTuple):
    """A step of parameters and states, with what of them stays open."""

    params: Array
    states: Array
    covariance: Array
    information: Array
    spread: Tridiagonal
    scores: Array
    by_params: Array

    @property
    def sds(self) -> Array:
        """Standard errors of the parameters."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def solve_step(
    groups: Sequence[Sums], variances: Array, prior: leastsq.Prior, params: Array
) -> Step:
    """One step of Gauss and Newton, the states eliminated. Raises `LinAlgError` where it leads out
    of all calibrations."""
    first, *others = (g.scale(1.0 / v) for g, v in zip(groups, variances, strict=True))
    total = first
    for group in others:
        total = total.add(group)
    total = total._replace(diagonal=total.diagonal + _LOOSE * np.eye(3))
    by_params, alone, information, pull, *_ = eliminate(total)
    residuals, jacobian = prior(params)
    covariance = leastsq.inverse(information + jacobian.T @ jacobian)
    step = -covariance @ (pull + jacobian.T @ residuals)
    if not np.abs(step).max() < _FARTHEST:
        raise np.linalg.LinAlgError("the steps leave every possible calibration")
    before = np.einsum("nip,ni->np", by_params, total.before)
    after = np.einsum("nip,ni->np", np.roll(by_params, -1, axis=0), total.after)
    scores = total.own + before + after
    move = alone + by_params @ step
    return Step(step, move, covariance, information, invert(total.states), scores, by_params)


def reduce_to_params(group: Sums, by_params: Array) -> Array:
    """What a group tells of the parameters where the states follow them, (p, p)."""
    moved = _multiply(group.states, by_params) + group.mixed
    along = np.tensordot(by_params, moved, axes=([0, 1], [0, 1]))
    return np.asarray(
        along + np.tensordot(group.mixed, by_params, axes=([0, 1], [0, 1])) + group.params
    )


def predict_cost(group: Sums, step: Step) -> float:
    """Σ w r² of a group after a step, to second order; before it where it turns too far."""
    move, by = step.states, step.params
    if np.abs(move).max() > _FAR:
        return group.cost
    along = 2 * group.gradient + _multiply(group.states, move[:, :, None])[:, :, 0]
    along = along + 2 * group.mixed @ by
    own = (2 * group.own.sum(axis=0) + group.params @ by) @ by
    return float(group.cost + np.sum(move * along) + own)


def _multiply(matrix: Tridiagonal, right: Array) -> Array:
    """H right of right sides (N, b, c)."""
    found = matrix.diagonal @ right
    found[1:] += matrix.below @ right[:-1]
    found[:-1] += np.swapaxes(matrix.below, 1, 2) @ right[1:]
    return np.asarray(found)


_BLOCK = 4096


def allow_for_correlation(
    problem: Problem,
    felt: Felt,
    attitudes: Array,
    params: Array,
    weights: Array,
    readings: Sums,
    variance: float,
    step: Step,
    prior: Array,
) -> Array:
    """The covariance where residuals go together in time: the larger of two views of it."""
    known, before = prior.T @ prior, step.covariance
    length = find_length(step.scores, step.information)
    alike = leastsq.inverse(step.information / length + known)
    lasting = find_lasting_errors(
        problem, felt, attitudes, params, weights, np.sqrt(variance), step.by_params, before
    )
    if lasting is None:
        return alike
    white, added = lasting
    own = reduce_to_params(readings, step.by_params) / variance
    apart = before @ (step.information + (white - 1.0) * own + known) @ before + added
    precision = step.information + known
    return max(alike, apart, key=lambda found: float(np.sum(found * precision)))


def find_length(scores: Array, information: Array) -> float:
    """By how much sums of scores (k, p) over longer times scatter more than white noise would."""
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    values, axes = np.linalg.eigh(information / np.outer(size, size))
    known = values > MIN_INFORMATION * values[-1]
    white = (scores / size) @ (axes[:, known] / np.sqrt(values[known]))
    return measure_correlation(white, np.eye(int(known.sum())))


def find_lasting_errors(
    problem: Problem,
    felt: Felt,
    attitudes: Array,
    params: Array,
    weights: Array,
    noise_sd: float,
    by_params: Array,
    covariance: Array,
) -> tuple[float, Array] | None:
    """The variance of white readings beside errors that last in the axes of the sensor, and what
    these add to the covariance (p, p); `None` where products of residuals show none."""
    track, n = felt.track, len(attitudes)
    root = np.linalg.cholesky(covariance)
    each = -(-n // STRETCHES)
    block = each * max(_BLOCK // each, 1)
    along, holds = [], []
    for start in range(0, n, block):
        rows = slice(start, start + block)
        left, by_state, direct = compare_readings(
            problem.subset(rows), attitudes[rows], felt.rate[rows], params, felt
        )
        before, share = track.interval[rows], track.share[rows, None, None]
        after = np.minimum(before + 1, len(by_params) - 1)
        moved = (1.0 - share) * by_params[before] + share * by_params[after]
        whole = ((direct + by_state @ moved) @ root) / noise_sd
        out = choose_free(by_state)
        seen = np.einsum("ni,ni->n", out, left) / noise_sd
        told = np.einsum("ni,nip->np", out, whole)
        along.append(Stretches.of(seen, told, weights[rows], out, each))
        weighted = whole * weights[rows, None, None]
        holds.append(np.add.reduceat(weighted, np.arange(0, len(left), each), axis=0))
    sums = Stretches(*(np.concatenate(of) for of in zip(*along, strict=True)))
    memory = find_memory(sums, np.eye(len(root)), (slice(0, 3),))
    if memory is None:
        return None
    scatter = sum_scatter(np.concatenate(holds), memory.each)
    return memory.white, np.asarray(root @ scatter @ root.T)


SETTLED = 0.02
"""Of a standard error, or of a variance: what moves less has settled."""
_STEPS = 6  # of the variances in a round
_LEAST_FORCE = 1e-3  # m/s²: no accelerometer's row is better
_LEAST_RATE = 1e-5  # rad/s: nor a gyro's
_USUAL_RATE = 1e-3  # rad/s/√Hz, of a gyro
_SMALLEST = 1e-3  # of the variance that a gyro shows
_TUKEY = 0.961  # Σ w q / Σ w of Gaussian vectors under Tukey's loss, q = r²/3
_CAUCHY = 0.914  # the same under Cauchy's
_DOUBT = 0.2  # of the logarithm of the variance that rates and force start from
_LOGS = np.linspace(-6.0, 24.0, 6001)
_ALIKE = 1.5  # variances below and above the corner of the low-pass
_TOGETHER = 0.3  # correlation of a row's force with the next
_LEAST_FREEDOM = 0.05  # of the residuals


class Expected(NamedTuple):
    """What is known beforehand of the noise of readings, force and rates, (3,) each. The least
    variances; those to start from, 0 where nothing is expected: that of the rates is told by third
    differences, which a motion that jitters makes too large; which part of white noise is left of
    each kind, less where it is smoothed; and what a robust loss leaves of a variance."""

    least: Array
    starts: Array
    passed: Array
    left: Array


def expect_noise(log: Log, readings_weighed: bool, slips_weighed: bool) -> Expected:
    """What the log itself tells of its noise."""
    least = np.array([1e-9, max(log.force_sd, _LEAST_FORCE), max(log.rate_sd, _LEAST_RATE)]) ** 2
    starts = least * [0.0, 1.0, log.rate_sd > _LEAST_RATE]  # rates between rows show no noise
    passed = np.array([1.0, find_passed(log.step_s, log.settling_s), 1.0])
    left = np.array([_TUKEY if readings_weighed else 1.0, 1.0, _CAUCHY if slips_weighed else 1.0])
    return Expected(least, starts, passed, left)


def start_variances(log: Log, expected: Expected, noise_sd: float) -> Array:
    """The variances to start from, with that of known headings where there are any."""
    first = np.maximum(expected.least, [noise_sd**2, 0.0, 0.0])
    first[2] = max(first[2], _USUAL_RATE**2 / log.step_s)  # too stiff a gyro would stay so
    return first if log.headings is None else np.append(first, 1.0)


def settle(
    groups: Sequence[Sums],
    variances: Array,
    expected: Expected,
    memory: float,
    scatter: float | None,
    prior: leastsq.Prior,
    params: Array,
) -> tuple[Step, Array]:
    """The step with the variances that it leaves, found by turns."""
    for _ in range(_STEPS):
        step = solve_step(groups, variances, prior, params)
        updated = update_variances(groups[:3], variances, expected, step) / expected.left
        # the variance of white noise that pulls as much as the force does for long: batch means
        pulls = (groups[1].before + groups[1].after)[:, :2] / STANDARD_GRAVITY_M_S2
        updated[1] *= measure_correlation(pulls, updated[1] * groups[1].size / 3 * np.eye(2))
        updated = np.maximum(updated, expected.least * [1.0, 0.0, _SMALLEST]) * [memory, 1.0, 1.0]
        if scatter is not None:
            updated = np.append(updated, scatter)
        change, variances = np.abs(np.log(updated / variances)).max(), updated
        if change < SETTLED:
            break
    return step, variances


def update_variances(
    groups: Sequence[Sums], variances: Array, expected: Expected, step: Step
) -> Array:
    """The variance of each kind after a step: Σ w r² over its own share of the freedom (Förstner
    1979), which is that of restricted likelihood."""
    found, (_, starts, passed, _) = [], expected
    for group, variance, start, share in zip(groups, variances, starts, passed, strict=False):
        fitted = np.einsum("nij,nji->", group.states.diagonal, step.spread.diagonal)
        fitted += 2 * np.einsum("nij,nij->", group.states.below, step.spread.below)
        fitted += np.einsum("ij,ji->", reduce_to_params(group, step.by_params), step.covariance)
        size = share * group.size
        freedom = max(size - float(fitted) / variance, _LEAST_FREEDOM * size)
        cost = max(predict_cost(group, step), 0.0)
        spread = cost / freedom if freedom > 0.0 else start  # where none tells it
        found.append(settle_variance(spread, freedom, start))
    return np.array(found)


def settle_variance(found: float, freedom: float, start: float) -> float:
    """The most probable variance θ of so many residuals that were expected to have another one, θ₀.
    What is expected is either right or far off, so u = log(θ/θ₀) has a Cauchy prior of scale s:

        ν/2 (u + found/θ) + log(1 + (u/s)²) is least,   θ = θ₀ eᵘ,   s = `_DOUBT`.

    Where nothing is expected, θ₀ = 0, it is what was found."""
    if start <= 0.0:
        return found
    cost = freedom / 2 * (_LOGS + found / start * np.exp(-_LOGS)) + np.log1p((_LOGS / _DOUBT) ** 2)
    return float(start * np.exp(_LOGS[np.argmin(cost)]))


def measure_memory(along: Array, weights: Array, interval: Index) -> float:
    """By how much readings scatter more for long than white noise does: batch means."""
    weighted = weights * along
    sums = np.bincount(interval, weighted)[:, None].astype(np.float64)
    white = np.array([[float(weighted @ weighted)]])
    return measure_correlation(sums, white)


def weigh_slips(slips: Array, variance: float) -> Array:
    """How much each step of the gyro counts, by its square (N − 1,) of three numbers."""
    return cauchy().weight(slips / (3 * variance))


def is_white(log: Log, felt: Felt, attitudes: Array, below: float) -> bool:
    """Whether the force is as noisy above the corner of the low-pass as `below`, a variance, and
    each row by itself. Then nothing is to be smoothed away, and what the force says of fast
    attitude is worth as much as it states. A vehicle that is shaken moves from row to row."""
    level, *_ = steady_force(log._replace(settling_s=0.0), felt, attitudes)
    left = level - UP_AT_REST
    whole = float(np.mean(left**2))
    together = float(np.mean(left[1:] * left[:-1])) / whole
    return bool(below / _ALIKE < whole < below * _ALIKE) and together < _TOGETHER
