"""The joint estimate: readings, acceleration and rates at once, the attitude of every moment free.

Attitudes are states half a second apart (`rotations.track`). They are eliminated exactly, so what
is left is the likelihood of bias, matrix and errors of the inertial unit, and the slow errors of
tilt and azimuth are weighted as what they are. With H the normal equations of states x and
parameters θ, the information of θ is H_θθ − H_θx H_xx⁻¹ H_xθ.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.inertial.maths.factors import Log, sum_force, sum_rate, sum_readings, take_out
from agonic.inertial.maths.headings import sum_headings
from agonic.maths.equation.channels import Problem
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.filters.block_tridiagonal import Tridiagonal, invert, solve
from agonic.maths.estimation.loss import Loss, squares
from agonic.maths.estimation.noise.batch_means import compute_scatter
from agonic.maths.rotations.track import Sums, Track, find_attitudes
from agonic.units import STANDARD_GRAVITY_M_S2

_ROUNDS = 15
_SETTLED = 0.02  # of a standard error, or of a variance
_LOOSE = 1e-6  # what is known of a state beforehand, over 1/rad²
_FEWEST = 8  # batches that tell a scatter
_LEAST_FORCE = 1e-3  # m/s²: no accelerometer's row is better
_RATES_KNOWN = 10.0  # residuals that the third differences of the rates count as
_TUKEY = 0.961  # Σ w q / Σ w of Gaussian vectors under Tukey's loss, q = r²/3


class Joint(NamedTuple):
    """The joint estimate: parameters (p,) and their covariance; attitudes (N, 3, 3) of the states
    and their track; the noise of a reading, a force and a rate, and of headings in units of what
    they state; how much each reading counts; the gain (3, 3) of the accelerometer, and the offset
    of the headings, rad."""

    params: Array
    covariance: Array
    information: Array
    states: Array
    track: Track
    sds: Array
    weights: Array
    gain: Array
    offset: float


class _Step(NamedTuple):
    """A step of parameters and states, with what of them stays open."""

    params: Array
    states: Array
    covariance: Array
    information: Array
    spread: Tridiagonal
    scores: Array


def estimate_jointly(
    problem: Problem,
    log: Log,
    params: Array,
    start: Array,
    usable: Array,
    noise_sd: float,
    loss: Loss,
) -> Joint:
    """The estimate from near parameters and attitudes.

    The noise of readings and rates is that of what is left of them, over its own share of the
    freedom; that of the force what pulls for long, for a vehicle that brakes or slips leans its
    level for seconds.

    Parameters: a problem with `shared` errors of the unit, of all rows of the log; its parameters;
    attitudes (n, 3, 3) from the sensor's axes to magnetic north, east and down; weights (n,) of the
    readings, and their noise and loss.
    """
    params = np.concatenate([params, np.zeros(log.extra)])
    prior = _add_gains(problem, log.extra)
    least = np.array([1e-9, max(log.force_sd, _LEAST_FORCE), max(log.rate_sd, 1e-5)]) ** 2
    variances = np.maximum(least, [noise_sd**2, 0.0, 0.0])
    by_headings: tuple[Sums, ...] = ()
    if log.headings is not None:
        variances = np.append(variances, 1.0)
    weights, states = usable, start[take_out(log, params).track.nodes]
    for turn in range(_ROUNDS):
        felt = take_out(log, params)
        attitudes = find_attitudes(felt.track, states)
        readings, distances = sum_readings(problem, felt, attitudes, params, weights)
        force = sum_force(log, felt, attitudes)
        groups = (readings, force, sum_rate(log, felt, states, attitudes))
        if log.headings is not None:
            headings, scatter = sum_headings(log.headings, felt.track, attitudes, params)
            by_headings = (headings,)
        step = _solve((*groups, *by_headings), variances, prior, params)
        params = params + step.params
        states = Rotation.from_rotvec(step.states).as_matrix() @ states
        if turn:
            expected = 1.0 if loss is squares() else _TUKEY
            updated = _update(groups, variances[:3], least, step.spread) / [expected, 1.0, 1.0]
            updated[1] = _measure_force(force, least[1])
            updated[0] = max(updated[0], least[0])
            if by_headings:
                updated = np.append(updated, scatter)
            change = np.abs(np.log(updated / variances)).max()
            variances = updated
            weights = usable * loss.weight(distances / (3 * variances[0]))
            sd = np.sqrt(np.diag(step.covariance))
            if max(change, np.abs(step.params / sd).max()) < _SETTLED:
                break
    return Joint(
        params,
        _allow_for_correlation(step, prior(params)[1]),
        step.information,
        states,
        felt.track,
        np.sqrt(variances),
        weights,
        np.eye(3) + np.tensordot(params[len(params) - log.extra :][: len(log.gains)], log.gains, 1),
        0.0 if log.headings is None else float(params[-1] * log.headings.offset_sd),
    )


def _add_gains(problem: Problem, count: int) -> leastsq.Prior:
    """The priors of the problem, and of gains in units of their standard deviations."""
    known = problem.prior(problem.soft_iron_sd)
    assert known is not None, "shared errors have a prior"

    def prior(params: Array) -> tuple[Array, Array]:
        p = len(params) - count
        residuals, jacobian = known(params[:p])
        whole = np.zeros((len(residuals) + count, len(params)))
        whole[: len(residuals), :p] = jacobian
        whole[len(residuals) :, p:] = np.eye(count)
        return np.concatenate([residuals, params[p:]]), whole

    return prior


def _solve(
    groups: tuple[Sums, ...], variances: Array, prior: leastsq.Prior, params: Array
) -> _Step:
    """One step of Gauss and Newton, the states eliminated."""
    first, *others = (g.scale(1.0 / v) for g, v in zip(groups, variances, strict=True))
    total = first
    for group in others:
        total = total.add(group)
    states = Tridiagonal(total.states.diagonal + _LOOSE * np.eye(3), total.states.below)
    gradient = total.gradient
    found = solve(states, np.concatenate([total.mixed, gradient[:, :, None]], axis=2))
    by_params, alone = -found[:, :, :-1], -found[:, :, -1]
    residuals, jacobian = prior(params)
    information = total.params + np.tensordot(total.mixed, by_params, axes=([0, 1], [0, 1]))
    pull = total.own.sum(axis=0) + np.einsum("nip,ni->p", total.mixed, alone)
    covariance = leastsq.inverse(information + jacobian.T @ jacobian)
    step = -covariance @ (pull + jacobian.T @ residuals)
    before = np.einsum("nip,ni->np", by_params, total.before)
    after = np.einsum("nip,ni->np", np.roll(by_params, -1, axis=0), total.after)
    scores = total.own + before + after
    move = alone + by_params @ step
    return _Step(step, move, covariance, information, invert(states), scores)


def _update(groups: tuple[Sums, ...], variances: Array, least: Array, spread: Tridiagonal) -> Array:
    """The variance of each kind: Σ w r² over its own share of the freedom (Förstner 1979).

    That of the rates starts from their third differences, which a motion that jitters makes too
    large; a short log knows no better.
    """
    found = []
    for group, variance, prior in zip(groups, variances, [0.0, 0.0, least[2]], strict=True):
        fitted = np.einsum("nij,nji->", group.states.diagonal, spread.diagonal)
        fitted += 2 * np.einsum("nij,nij->", group.states.below, spread.below)
        freedom = max(group.size - float(fitted) / variance, 0.05 * group.size)
        few = _RATES_KNOWN if prior else 0.0
        found.append((group.cost + few * prior) / (freedom + few))
    return np.array(found)


def _measure_force(force: Sums, least: float) -> float:
    """The variance of white noise that pulls as much as the force does for long: batch means."""
    pulls = (force.before + force.after)[:, :2] / STANDARD_GRAVITY_M_S2
    white = least * force.size / 3 * np.eye(2)
    return least * compute_scatter(pulls, white, fewest=_FEWEST).correlation


def _allow_for_correlation(step: _Step, prior: Array) -> Array:
    """The covariance where sums of scores over longer times scatter more than white noise would."""
    size = np.sqrt(np.maximum(np.diag(step.information), 1e-300))
    values, axes = np.linalg.eigh(step.information / np.outer(size, size))
    known = values > 1e-6 * values[-1]
    white = (step.scores / size) @ (axes[:, known] / np.sqrt(values[known]))
    length = compute_scatter(white, np.eye(int(known.sum())), fewest=_FEWEST).correlation
    return leastsq.inverse(step.information / length + prior.T @ prior)
