"""A calibration followed beside a gyro: by how the field turns, and by its magnitude if known.

Field and bias are linear, and to begin with they are all that is estimated; what the gyro's bias,
the delay and the matrix do is not, and is estimated as soon as those are known. Nothing has to be
gone back to after a jump: what was known of the field outlasts it, for the gyro carries it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.calibration.tracking import (
    MAX_SETTLED_SD,
    Jump,
    Opening,
    Recent,
    TrackerParams,
    TrackerState,
)
from agonic.maths.equation.symmetric import pack_symmetric, unpack_symmetric
from agonic.maths.estimation.filters import kalman, states
from agonic.maths.estimation.filters.jump_test import LOST
from agonic.maths.estimation.noise.residuals import robust_scale

OPENING = 128
"""Readings by which a noise that was not given is found."""
EVENT_S = 2.0
"""Jumps that follow one another within this are one: a magnet that is brought near."""
LOST_S = 10.0
"""Jumps that go on for longer are none: field and bias are unknown, and found anew."""

_LOOK = 16  # readings between which an opening is looked at


def begin(state: TrackerState, params: TrackerParams, row: Array) -> TrackerState:
    """The state with its prior, now that a reading is known; opened where it is not yet linear.

    Also once more, from nothing but the calibration, where all was lost on the way.
    """
    m = states.BESIDE_GYRO.sizes[params.solve]
    symmetric = state.turned.rotation.T @ state.base.matrix
    gain = float(np.mean(np.diag(symmetric)))
    size = max(float(row[7]) / gain or float(np.sqrt((row[1:4] ** 2).sum())), 1e-6)
    fresh, lost = state.base.covariance is None, state.n > 0
    moved = size if lost else params.bias_sd or (size if fresh else size / 20)
    away = params.matrix_sd or (0.1 * gain if fresh else 0.0)
    covariance = np.zeros((16, 16))
    coefficients = np.r_[3:6, 10:16]
    covariance[np.ix_(coefficients, coefficients)] = state.turned.covariance[:9, :9]
    spread = [(3.0 * gain * size) ** 2] * 3 + [moved**2] * 3 + [params.gyro_bias_sd**2] * 3
    covariance += np.diag([*spread, params.delay_sd_s**2, *[away**2] * 6])
    if row[7] == 0.0:  # nothing tells how long the field is: the matrix keeps its mean gain
        along = covariance[:, 10:13].sum(axis=1)
        covariance -= np.outer(along, along) / max(along[10:13].sum(), 1e-300)
    bias = state.bias if lost else state.base.bias
    known = np.concatenate([np.zeros(3), bias, np.zeros(4), pack_symmetric(symmetric)])
    prior = states.start_filter(known, covariance[:m, :m], float(row[0]))
    learns = bool(np.sqrt(covariance.diagonal()[3:6].max()) < MAX_SETTLED_SD * size)
    opened = Opening(prior=prior, rows=np.empty((0, states.BESIDE_GYRO.row)), learns=learns)
    return replace(
        state,
        estimate=prior if learns else _fix_all_but_bias(prior),
        noise=state.noise if state.noise_known else 0.01 * size,
        opening=None if learns and state.noise_known else opened,
        recent=None,
        magnitude=gain * size,
    )


def _fix_all_but_bias(prior: states.FilterState) -> states.FilterState:
    """A filter of field and bias alone, which are linear."""
    covariance = prior.covariance
    covariance[6:] = covariance[:, 6:] = 0.0
    return states.start_filter(prior.state, covariance, prior.time)


def count_at_once(state: TrackerState, times: Array) -> int:
    """How many readings to take at once: up to the next thing to be done between two."""
    if state.opening is not None:
        return _LOOK - state.n % _LOOK
    if state.recent is None:
        return len(times)
    second = np.floor(times - state.jumps[-1].seen)
    return int(np.searchsorted(second, second[0], side="right"))


def step(
    state: TrackerState, params: TrackerParams, rows: Array, fast: bool
) -> tuple[TrackerState, kalman.Predictions]:
    """The state after a few readings (n, 9), and what was predicted of them."""
    opening, model = state.opening, _find_model(state, params)
    estimate, seen, jumped = kalman.advance(state.estimate, model, rows, compiled=fast)
    taken = rows[: len(seen.used)]
    after = state.moved(
        estimate=estimate,
        n=state.n + len(taken),
        refused=state.refused + int(np.count_nonzero(~seen.used)),
        magnitude=float(taken[-1, 7]) or float(np.sqrt((estimate.field**2).sum())),
    )
    if jumped:
        size = float(np.abs(seen.residual[-1]).max())
        after = _note_jump(after, params, taken[-1], size)
    if opening is None:
        return _measure_jump(after), seen
    if after.opening is None:
        return after, seen
    if not after.noise_known:
        opening = replace(opening, rows=np.concatenate([opening.rows, taken]))
        after = replace(after, opening=opening)
    if after.n % _LOOK or not (after.noise_known or len(opening.rows) >= OPENING):
        return after, seen
    if not after.noise_known:
        after = _repeat(after, params, opening, fast)
    return (replace(after, opening=None) if opening.learns else _release(after, opening)), seen


def _find_model(state: TrackerState, params: TrackerParams) -> states.Model:
    """The noise model; in an opening what is not estimated yet is noise of gyro and readings."""
    model, opening = params.model(state.noise), state.opening
    if opening is None:
        return model
    if opening.learns:
        return model._replace(jump_level=0.0)
    # a gyro's bias of unknown direction adds up for a second
    gyro_noise = float(np.hypot(params.gyro_noise, params.gyro_bias_sd))
    away = _measure_matrix_sd(state, opening.prior.covariance)
    return model._replace(gyro_noise=gyro_noise, late_s=params.delay_sd_s, away=away)


def _measure_matrix_sd(state: TrackerState, covariance: Array) -> float:
    """The largest standard error of the matrix, of its gain; 0 where it is not estimated."""
    gain = float(np.mean(state.estimate.matrix[:3]))
    return float(np.sqrt(covariance.diagonal()[10:].max(initial=0.0))) / gain


def _note_jump(state: TrackerState, params: TrackerParams, row: Array, size: float) -> TrackerState:
    """The state after a jump was seen; the same jump as the last one if that has not ended."""
    estimate, recent, jumps = state.estimate, state.recent, list(state.jumps)
    size = max(params.jump_sd, 2.0 * size)
    if state.opening is not None:  # nothing that was known has jumped
        gain = float(np.mean(estimate.matrix[:3]))
        return replace(state, estimate=states.widen_for_jump(estimate, size, gain * size))
    if recent is None and not state.settled:
        return _keep_watch(begin(state, params, row), estimate)
    if recent is None:
        recent = Recent(
            before=estimate, middle=estimate, rows=np.empty((0, states.BESIDE_GYRO.row))
        )
        lost_s = float(estimate.watched[LOST])  # since a reading fitted its prediction
        began, unknown = estimate.time - lost_s, np.full(3, params.jump_sd)
        jumps.append(Jump(time=began, seen=began, shift=np.zeros(3), shift_sd=unknown))
    jumps[-1] = replace(jumps[-1], seen=estimate.time)
    if estimate.time - jumps[-1].time > LOST_S:
        last = replace(jumps[-1], shift=estimate.bias - recent.before.bias)
        state = replace(state, jumps=(*jumps[:-1], last))
        return _keep_watch(begin(state, params, row), estimate)
    wide = states.widen_for_jump(estimate, size)
    return replace(state, estimate=wide, recent=recent, jumps=tuple(jumps))


def _keep_watch(state: TrackerState, before: states.FilterState) -> TrackerState:
    """The state with what its filter watched, but for the jump test."""
    watching = state.estimate._replace(watched=before.watched)
    return replace(state, estimate=states.forget_sums(watching))


def _measure_jump(state: TrackerState) -> TrackerState:
    """The state with its last jump measured, once nothing jumps any more and the bias is known."""
    if state.recent is None or state.time - state.jumps[-1].seen < EVENT_S:
        return state
    before, now = state.recent.before, state.estimate
    size = (state.magnitude or 0.0) / float(np.mean(now.matrix[:3]))
    if not np.sqrt(np.diag(now.covariance)[3:6].max()) < 0.01 * size:  # of the field
        return state
    shift = now.bias - before.bias
    variance = [np.diag(one.covariance)[3:6] for one in (before, now)]
    last = replace(state.jumps[-1], shift=shift, shift_sd=np.sqrt(sum(variance)))
    return replace(state, recent=None, jumps=(*state.jumps[:-1], last))


def _repeat(
    state: TrackerState, params: TrackerParams, opening: Opening, fast: bool
) -> TrackerState:
    """The first readings once more, with the noise that they show."""
    rows = opening.rows
    step_s = float(np.median(np.diff(rows[:, 0])))
    gain = float(np.mean(state.estimate.matrix[:3]))
    # noise that lasts from reading to reading shows in those that are some apart
    # so long a gyro turns true
    apart = [n for n in (1, 2, 4, 8, 16) if n == 1 or n * step_s < 0.04]
    noise = max(_measure_noise(rows, state, n) for n in apart)
    # readings of few bits
    noise = max(noise, 1e-4 * (state.magnitude or 1.0) / gain)
    prior = opening.prior if opening.learns else _fix_all_but_bias(opening.prior)
    model = _find_model(replace(state, noise=noise), params)._replace(jump_level=0.0)
    estimate, seen, _ = kalman.advance(prior, model, opening.rows, compiled=fast)
    return replace(
        state,
        estimate=estimate,
        noise=noise,
        noise_known=True,
        opening=replace(opening, rows=opening.rows[:0]),
        refused=int(np.count_nonzero(~seen.used)),
    )


def _release(state: TrackerState, opening: Opening) -> TrackerState:
    """The state with all that is asked for estimated, where field and bias alone are settled.

    What is known from before is taken as a guess, for it was found without the rest.
    """
    found = state.estimate
    gain = float(np.mean(found.matrix[:3]))
    size = float(np.sqrt((found.field**2).sum())) / gain
    sd = float(np.sqrt(np.diag(found.covariance)[3:6].max()))
    if not sd < 0.02 * size:  # then the rest is estimated too
        return state
    covariance = opening.prior.covariance
    away = _measure_matrix_sd(state, covariance)
    loose = max(3.0 * sd, MAX_SETTLED_SD * size, away * size)
    covariance[:6] = covariance[:, :6] = 0.0
    covariance[range(6), range(6)] = [(gain * loose) ** 2] * 3 + [loose**2] * 3
    state_now = np.concatenate([found.state[:6], opening.prior.state[6:]])
    begun = states.start_filter(state_now, covariance, found.time)
    return _keep_watch(replace(state, estimate=begun, opening=None), found)


def _measure_noise(rows: Array, state: TrackerState, apart: int) -> float:
    """The sd of a reading by pairs that are some readings `apart`, turned into one another by A.

    raw − A raw₋ = (1 − A) b + (A E − E A) raw₋ + noise, with 1 + E what the matrix W is off and
    A = W⁻¹ R W; solved again with W (1 + E), for E² would count as noise.
    """
    rate = 0.5 * (rows[1:, 4:7] + rows[:-1, 4:7])
    steps = Rotation.from_rotvec(rate * np.diff(rows[:, 0])[:, None])
    turned = [Rotation.identity()]
    for k in range(len(steps)):
        turned.append(turned[-1] * steps[k])
    attitude = Rotation.concatenate(turned)
    turns = (attitude[apart:].inv() * attitude[:-apart]).as_matrix()
    matrix, noise = state.base.matrix, np.inf
    for _ in range(4):
        by_turn = np.linalg.inv(matrix) @ turns @ matrix
        found, off = _turn_into_later(rows[:-apart, 1:4], rows[apart:, 1:4], by_turn)
        if not found < noise:
            break
        noise = found
        # more than few readings can tell
        if not np.abs(off).max() < 0.3:
            break
        matrix = matrix @ (np.eye(3) + off)
    return noise


def _turn_into_later(earlier: Array, later: Array, turns: Array) -> tuple[float, Array]:
    """The sd of what is left of later readings after earlier ones turned, and E (3, 3)."""
    errors = unpack_symmetric(np.eye(6))
    by_matrix = np.einsum("kij,ejl,kl->kie", turns, errors, earlier)
    by_matrix -= np.einsum("eij,kjl,kl->kie", errors, turns, earlier)
    by_all = np.concatenate([np.eye(3) - turns, by_matrix], axis=2).reshape(-1, 9)
    change = (later - np.einsum("kij,kj->ki", turns, earlier)).ravel()
    size = np.maximum(np.sqrt((by_all**2).sum(axis=0)), 1e-300)
    found = np.linalg.lstsq(by_all / size, change, rcond=1e-3)[0]
    left = float(robust_scale(change - by_all @ (found / size)) / np.sqrt(2.0))
    return left, unpack_symmetric((found / size)[3:])
