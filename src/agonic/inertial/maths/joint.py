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
from agonic.inertial.maths.correlation import allow_for_correlation
from agonic.inertial.maths.factors import Log, sum_force, sum_rate, sum_readings, take_out
from agonic.inertial.maths.headings import sum_headings
from agonic.inertial.maths.noise import is_white, measure_force, update_variances
from agonic.inertial.maths.step import solve_step
from agonic.maths.equation.channels import Problem
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.filters.block_tridiagonal import Tridiagonal
from agonic.maths.estimation.loss import Loss, squares
from agonic.maths.rotations.low_pass import find_passed
from agonic.maths.rotations.track import Sums, Track, find_attitudes

_ROUNDS = 15
_SETTLING = 6  # steps of the variances in a round
_SETTLED = 0.02  # of a standard error, or of a variance
_LEAST_FORCE = 1e-3  # m/s²: no accelerometer's row is better
_LEAST_RATE = 1e-5  # rad/s: nor a gyro's
_USUAL_RATE = 1e-3  # rad/s/√Hz, of a gyro
_SMALLEST = 1e-3  # of the variance that a gyro shows
_TUKEY = 0.961  # Σ w q / Σ w of Gaussian vectors under Tukey's loss, q = r²/3
_FARTHEST = 1e3  # of the size of a parameter: a step so long leads out of all calibrations


class Joint(NamedTuple):
    """The joint estimate: parameters (p,) and their covariance; attitudes (N, 3, 3) of the states
    and their track; the noise of a reading, a force and a rate, and of headings in units of what
    they state; how much each reading counts; the gain (3, 3) of the accelerometer, the offset
    of the headings, rad, and the variance of the tilt's errors over that of the tilt."""

    params: Array
    covariance: Array
    information: Array
    states: Array
    track: Track
    sds: Array
    weights: Array
    gain: Array
    offset: float
    tilt_noise: float


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
    least = np.array([1e-9, max(log.force_sd, _LEAST_FORCE), max(log.rate_sd, _LEAST_RATE)]) ** 2
    variances = np.maximum(least, [noise_sd**2, 0.0, 0.0])
    starts = least * [0.0, 1.0, log.rate_sd > _LEAST_RATE]  # rates between rows show no noise
    step_s = float(np.median(np.diff(log.time)))
    variances[2] = max(variances[2], _USUAL_RATE**2 / step_s)  # too stiff a gyro would stay so
    passed = np.array([1.0, find_passed(step_s, log.settling_s), 1.0])
    by_headings: tuple[Sums, ...] = ()
    if log.headings is not None:
        variances = np.append(variances, 1.0)
    weights, states = usable, start[take_out(log, params).track.nodes]
    expected = 1.0 if loss is squares() else _TUKEY
    for turn in range(_ROUNDS):
        felt = take_out(log, params)
        attitudes = find_attitudes(felt.track, states)
        readings, distances = sum_readings(problem, felt, attitudes, params, weights)
        force = sum_force(log, felt, attitudes)
        if turn > 1 and log.settling_s and is_white(log, felt, attitudes, variances[1]):
            log, passed = log._replace(settling_s=0.0), np.ones(3)
            force = sum_force(log, felt, attitudes)
        groups = (readings, force, sum_rate(log, felt, states, attitudes))
        if log.headings is not None:
            headings, scatter = sum_headings(log.headings, felt.track, attitudes, params)
            by_headings = (headings,)
        before = variances
        for _ in range(_SETTLING if turn else 1):
            step = solve_step((*groups, *by_headings), variances, prior, params)
            if not np.abs(step.params).max() < _FARTHEST:
                raise np.linalg.LinAlgError("the steps leave every possible calibration")
            if not turn:
                break
            updated = update_variances(groups, variances, starts, passed, step) / [
                expected,
                1.0,
                1.0,
            ]
            updated[1] = measure_force(force, updated[1])
            updated = np.maximum(updated, least * [1.0, 0.0, _SMALLEST])
            if by_headings:
                updated = np.append(updated, scatter)
            change = np.abs(np.log(updated / variances)).max()
            variances = updated
            if change < _SETTLED:
                break
        params = params + step.params
        states = Rotation.from_rotvec(step.states).as_matrix() @ states
        if turn:
            weights = usable * loss.weight(distances / (3 * variances[0]))
            change = np.abs(np.log(variances / before)).max()
            sd = np.sqrt(np.diag(step.covariance))
            if max(change, np.abs(step.params / sd).max()) < _SETTLED:
                break
    return Joint(
        params,
        allow_for_correlation(
            problem,
            felt,
            attitudes,
            params,
            weights,
            readings,
            variances[0],
            step,
            prior(params)[1],
        ),
        step.information,
        states,
        felt.track,
        np.sqrt(variances),
        weights,
        np.eye(3) + np.tensordot(params[len(params) - log.extra :][: len(log.gains)], log.gains, 1),
        0.0 if log.headings is None else float(params[-1] * log.headings.offset_sd),
        _compare_tilt(states, step.spread),
    )


def _compare_tilt(states: Array, spread: Tridiagonal) -> float:
    """The variance of the tilt's errors over that of the tilt (N, 3, 3) without them."""
    errors = float(np.mean(spread.diagonal[:, 0, 0] + spread.diagonal[:, 1, 1]))
    seen = float(states[:, 2].var(axis=0).sum())
    return errors / max(seen - errors, 0.1 * errors)


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
