"""The joint estimate: readings, acceleration and rates at once, the attitude of every moment free.

Attitudes are states half a second apart (`rotations.track`). They are eliminated exactly, so what
is left is the likelihood of bias, matrix and errors of the inertial unit, and the slow errors of
tilt and azimuth are weighted as what they are. With H the normal equations of states x and
parameters θ, the information of θ is H_θθ − H_θx H_xx⁻¹ H_xθ.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.inertial.maths.factors import (
    Felt,
    Log,
    sum_force,
    sum_headings,
    sum_rate,
    sum_readings,
    take_out,
)
from agonic.inertial.maths.noise import (
    SETTLED,
    allow_for_correlation,
    expect_noise,
    is_white,
    measure_memory,
    settle,
    solve_step,
    start_variances,
    weigh_slips,
)
from agonic.maths.equation.channels import Problem
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.filters.smoother import Sums
from agonic.maths.estimation.loss import Loss, squares
from agonic.maths.rotations.attitude import make_rotation
from agonic.maths.rotations.track import Track, find_attitudes

_ROUNDS = 15
_NEAR = 5  # after so many what is left tells the noise, not the way


class Joint(NamedTuple):
    """The joint estimate: parameters (p,) and their covariance; attitudes (N, 3, 3) of the states
    and their track; the noise of a reading, a force and a rate, and of headings in units of what
    they state, and the variances by which they count; how much each reading counts, and each step
    of the gyro; the gain (3, 3) of the accelerometer, the offset of the headings, rad, and the
    variance of the tilt's errors over that of the tilt; the log by whose low-pass it was found."""

    params: Array
    covariance: Array
    information: Array
    states: Array
    track: Track
    sds: Array
    variances: Array
    weights: Array
    counts: Array
    gain: Array
    offset: float
    tilt_noise: float
    log: Log


def estimate_jointly(
    problem: Problem,
    log: Log,
    params: Array,
    start: Array,
    usable: Array,
    noise_sd: float,
    loss: Loss,
    robust: bool = True,
) -> Joint:
    """The estimate from near parameters and attitudes. The noise of rates is that of what is left
    of them, over its own share of the freedom; that of readings and force what pulls for long:
    beside iron the field is wrong for as long as the vehicle is there, and one that brakes or slips
    leans its level for seconds. A moment in which the gyro lost its turn (clipped, shaken, read too
    seldom) counts little."""
    params = np.concatenate([params, np.zeros(log.extra)])
    prior = _add_gains(problem, log.extra)
    expected = expect_noise(log, loss != squares(), robust)
    variances = start_variances(log, expected, noise_sd)
    memory, weights, states = 1.0, usable, start[take_out(log, params).track.nodes]
    counts, change, near = np.ones(len(states) - 1), np.inf, False
    for turn in range(_ROUNDS):
        felt = take_out(log, params)
        attitudes = find_attitudes(felt.track, states)
        readings, distances, along = sum_readings(problem, felt, attitudes, params, weights)
        if near:
            before, memory = memory, measure_memory(along, weights, felt.track.interval)
            variances = variances * ([memory / before] + [1.0] * (len(variances) - 1))
        if turn > 1 and log.settling_s and is_white(log, felt, attitudes, variances[1]):
            log, expected = log._replace(settling_s=0.0), expected._replace(passed=np.ones(3))
        others, slips, scatter = _sum_unit(log, felt, states, attitudes, params, counts)
        groups = [readings, *others]
        if turn:
            step, settled = settle(groups, variances, expected, memory, scatter, prior, params)
            change, variances = np.abs(np.log(settled / variances)).max(), settled
        else:
            step = solve_step(groups, variances, prior, params)
        params = params + step.params
        states = make_rotation(step.states) @ states
        if turn:
            weights = usable * loss.weight(distances * memory / (3 * variances[0]))
            counts = weigh_slips(slips, variances[2]) if robust and near else counts
            done = max(change, np.abs(step.params / step.sds).max()) < SETTLED
            if done and near:
                break
            near = near or done or turn == _NEAR
    at = (problem, felt, attitudes, params, weights, readings, variances[0], step)
    covariance = allow_for_correlation(*at, prior(params)[1])
    spread, seen = step.spread.diagonal, float(states[:, 2].var(axis=0).sum())
    tilt_errors = float(np.mean(spread[:, 0, 0] + spread[:, 1, 1]))
    return Joint(
        params,
        covariance,
        step.information,
        states,
        felt.track,
        np.sqrt(variances / ([memory] + [1.0] * (len(variances) - 1))),
        variances,
        weights,
        counts,
        np.eye(3) + np.tensordot(params[len(params) - log.extra :][: len(log.gains)], log.gains, 1),
        0.0 if log.headings is None else float(params[-1] * log.headings.offset_sd),
        tilt_errors / max(seen - tilt_errors, 0.1 * tilt_errors),
        log,
    )


def estimate_part(problem: Problem, whole: Joint, among: Mask) -> tuple[Array, Array]:
    """Parameters (p,) by some of the readings (n,) and all that the unit recorded, and their
    covariance: the noise and what counts how much are those of the whole.

    Raises `LinAlgError` where these readings determine nothing.
    """
    log, params, states, weights = whole.log, whole.params, whole.states, whole.weights * among
    prior = _add_gains(problem, log.extra)
    for _ in range(_ROUNDS):
        felt = take_out(log, params)
        attitudes = find_attitudes(felt.track, states)
        readings, *_ = sum_readings(problem, felt, attitudes, params, weights)
        others, *_ = _sum_unit(log, felt, states, attitudes, params, whole.counts)
        step = solve_step([readings, *others], whole.variances, prior, params)
        params, states = params + step.params, make_rotation(step.states) @ states
        if np.abs(step.params / step.sds).max() < SETTLED:
            break
    at = (problem, felt, attitudes, params, weights, readings, whole.variances[0], step)
    return params, allow_for_correlation(*at, prior(params)[1])


def _sum_unit(
    log: Log, felt: Felt, states: Array, attitudes: Array, params: Array, counts: Array
) -> tuple[list[Sums], Array, float | None]:
    """Sums of force, rates and headings, the slips of the gyro, and how headings scatter."""
    rates, slips = sum_rate(log, felt, states, attitudes, counts)
    groups, scatter = [sum_force(log, felt, attitudes), rates], None
    if log.headings is not None:
        headings, scatter = sum_headings(log.headings, felt.track, attitudes, params)
        groups.append(headings)
    return groups, slips, scatter


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
