"""A block more: whether a fault began, since when, how large, and in which compass."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.monitoring import (
    BOTH,
    DIMENSIONS,
    KEPT,
    LASTING,
    LENGTHS,
    NOISE_MEMORY,
    ODDS,
    PASSING,
    QUIET,
    TAILS,
    MonitorParams,
)
from agonic.headings.monitor.baseline import (
    Block,
    Q,
    R,
    S,
    State,
    V,
    describe,
    learn,
    measure,
)


class Seen(NamedTuple):
    """Of r and q: χ² of the windows (…, 2, 2) over their thresholds; the change (…, 2, 3) and its
    sd (…, 2) in nT and rad; blocks ago that it began (…, 2), and their sd; log odds (…, 2)."""

    share: Array
    change: Array
    sd: Array
    began: Array
    began_sd: Array
    odds: Array


def advance(params: MonitorParams, state: State, block: Block) -> tuple[State, Seen]:
    """The state after a block, and what is seen in the last ones.

    A window of n blocks is tested by T = |ē|²/(σₙ² + x̄ᵀP x̄), χ² of 3 or 2, with σₙ² measured of
    such windows, so that it holds whatever memory the errors have; m squares make the threshold
    m (e^{b²/m} − 1), the tail of F. In the mean no block counts for more than makes `PASSING` of
    them reach the threshold, and what was read in a field that both feel counts as no change.
    """
    residual, regressor = describe(block, state.level, params)
    # both magnetometers feel a field that is not the place's
    x = regressor[..., S, :]
    off = block.strength - (x * state.known[..., S, :, 0]).sum(axis=-1)[..., None]
    variance = state.power[..., S, 0] / state.weight[..., S]
    variance = variance + np.einsum("...i,...ij,...j->...", x, state.covariance[..., S, :, :], x)
    disturbed = np.asarray((off**2).min(axis=-1) > BOTH**2 * variance)
    sound = ~(disturbed[..., None] & np.array([True, False, True, True]))[..., None]
    calm = np.asarray(~(state.since > 0).any(axis=-1))
    state = learn(state, params, calm & (state.filled == KEPT))
    state = _push(state, residual * sound, regressor * sound)
    state = state._replace(level=block.level, skipped=state.skipped + disturbed)
    covariance = state.covariance
    errors = state.residual - np.einsum("...kgi,...gid->...kgd", state.regressor, state.known)
    means, own, share = _test(params, state, covariance, errors)
    state = _measure_noise(state, covariance, errors, means, own, calm)
    state, began, began_sd = _judge(state, errors, share)
    within = np.arange(KEPT)[::-1] < np.maximum(state.since, 1)[..., None]
    count = np.einsum("...gk,...kg->...g", within, state.regressor[..., :2, 0])
    change = np.einsum("...gk,...kgd->...gd", within, errors[..., :2, :])
    change = change / np.maximum(count, 1.0)[..., None]
    odds = np.zeros(state.since.shape)
    if state.since.any():
        odds = _weigh(params.field, state, covariance, errors, change, within)
    sure = (np.abs(odds) >= np.log(ODDS)) & (state.since > 0) & (state.named == 0)
    named = np.where(sure, np.where(odds > 0, 1, 2), state.named)
    sd = np.sqrt(own[..., :2, 1])
    return state._replace(named=named), Seen(share, change, sd, began, began_sd, odds)


def _push(state: State, residual: Array, regressor: Array) -> State:
    """The state with a block more in place of the oldest."""

    def add(kept: Array, new: Array) -> Array:
        return np.concatenate([kept[..., 1:, :, :], new[..., None, :, :]], axis=-3)

    return state._replace(
        residual=add(state.residual, residual),
        regressor=add(state.regressor, regressor),
        filled=np.minimum(state.filled + 1, KEPT),
        since=state.since + (state.since > 0),
    )


def _test(
    params: MonitorParams, state: State, covariance: Array, errors: Array
) -> tuple[Array, Array, Array]:
    """Means (…, 4, 2, 3) of the windows, their variances (…, 4, 2), and χ² over the thresholds."""
    means, own, share = [], [], []
    for j, n in enumerate(LENGTHS):
        last = errors[..., KEPT - n :, :, :]
        x = state.regressor[..., KEPT - n :, :, :].mean(axis=-3)
        known = state.square[..., j] / state.weight
        unknown = np.einsum("...gi,...gij,...gj->...g", x, covariance, x)
        total = known + unknown
        squares = np.array(DIMENSIONS) * state.weight / n
        level = np.full(4, params.alarm[:, j].min())
        level[:2] = params.alarm[:, j]
        level = squares * np.expm1(level / squares)
        most = np.sqrt(level * total) * n / PASSING
        size = np.linalg.norm(last, axis=-1)
        kept = last * np.minimum(1.0, most[..., None, :] / np.maximum(size, 1e-12))[..., None]
        mean = kept.mean(axis=-3)
        over = (mean**2).sum(axis=-1) / (level * total)
        means.append(mean)
        own.append(total)
        share.append(np.where((state.filled >= n)[..., None], over, 0.0)[..., :2])
    return np.stack(means, axis=-2), np.stack(own, axis=-1), np.stack(share, axis=-1)


def _measure_noise(
    state: State, covariance: Array, errors: Array, means: Array, own: Array, rows: Mask
) -> State:
    """The variances with this block's; of each square the part that is not the regressions'."""
    noise = state.square / state.weight[..., None]
    square = np.stack([measure(means[..., j, :]) for j in range(2)], axis=-1)
    square = np.minimum(square, QUIET * own) * noise / own
    x = state.regressor[..., -1, :, :]
    usual = state.power[..., 0] / state.weight
    total = usual + np.einsum("...gi,...gij,...gj->...g", x, covariance, x)
    last, before = errors[..., -1, :, :], errors[..., -2, :, :]
    power = np.stack([measure(last), (last * before).sum(axis=-1) / np.array(DIMENSIONS)], axis=-1)
    most = (QUIET * total)[..., None]
    power = np.clip(power, -most, most) * (usual / total)[..., None]
    full = (rows & (state.filled == KEPT))[..., None] & (x[..., 0] > 0.0)
    fade, chosen = 1.0 - 1.0 / NOISE_MEMORY, full[..., None]
    return state._replace(
        square=np.where(chosen, fade * state.square + square, state.square),
        power=np.where(chosen, fade * state.power + power, state.power),
        weight=np.where(full, fade * state.weight + 1.0, state.weight),
    )


def _judge(state: State, errors: Array, share: Array) -> tuple[State, Array, Array]:
    """The state with what begins and what ends, and when it began, in blocks ago, with its sd."""
    sums = np.cumsum(errors[..., ::-1, :2, :], axis=-3)
    count = np.arange(1.0, KEPT + 1.0)[:, None]
    gain = (sums**2).sum(axis=-1) / count
    block = LENGTHS[1] * state.square[..., :2, 1] / state.weight[..., :2]
    gain = np.where(count <= state.filled[..., None, None], gain / block[..., None, :], -1e9)
    likely = np.exp((gain - gain.max(axis=-2, keepdims=True)) / 2)
    likely = likely / likely.sum(axis=-2, keepdims=True)
    began = (likely * count).sum(axis=-2)
    spread = (likely * (count - began[..., None, :]) ** 2).sum(axis=-2)
    begins = (share.max(axis=-1) > 1.0) & (state.since == 0)
    # a quarter of the threshold is half the change
    ends = (share[..., 1] < 0.25) & (state.since > KEPT)
    since = np.where(begins, np.rint(began).astype(np.intp), np.where(ends, 0, state.since))
    named = np.where(ends | begins, 0, state.named)
    return state._replace(since=since, named=named), began, np.sqrt(spread + 1 / 12)


def _weigh(
    size: float, state: State, covariance: Array, errors: Array, change: Array, within: Mask
) -> Array:
    """Log odds (…, 2) that compass 1 changed and not 2, of r and q.

    A change β of r = f₁ − f₂ moves the mean of both magnitudes by ½ f̂·β where compass 1 changed,
    and by −½ f̂·β where 2 did; that of both vertical intensities, less what such magnitudes explain,
    by ±½ (down − f̂ sin dip)·β. One ε of q = down₁ − down₂ moves it by ±½ f·ε. With e what a
    block's residual does not share with the one before, eₖ − ρ eₖ₋₁, a the same of the signature,
    and w the variance:

        log odds = Σ (ν + 1)/2 · log[(1 + (e + a)²/νw) / (1 + (e − a)²/νw)]

    Parameters: size of the field, errors (…, k, 4, 3) of the last blocks, changes (…, 2, 3) of r
    and q, and which blocks are within (…, 2, k) the changes.
    """
    field, down = state.regressor[..., S, 1:], state.regressor[..., Q, 1:]
    sine = (field * down).sum(axis=-1, keepdims=True)
    level, across = (field - sine * down) * size, down - sine * field
    of_field, of_tilt = change[..., None, 0, :], change[..., None, 1, :]
    leaning = (down[..., :2] * of_tilt[..., :2]).sum(axis=-1)
    fallen = -leaning / np.maximum(down[..., 2], 0.1)
    by_tilt = (level[..., :2] * of_tilt[..., :2]).sum(axis=-1) + level[..., 2] * fallen
    signatures = (
        (R, S, (field * of_field).sum(axis=-1)),
        (R, V, (across * of_field).sum(axis=-1)),
        (Q, V, by_tilt),
    )
    odds = np.zeros(change.shape[:-1])
    for cause, group, signature in signatures:
        moved = np.where(within[..., cause, :], signature / 2, 0.0)
        odds[..., cause] += _compare(state, covariance, errors, group, moved)
    return odds


def _compare(state: State, covariance: Array, errors: Array, group: int, moved: Array) -> Array:
    """The log odds (…,) by one group of common residuals, of signatures (…, k) of a change."""
    there = state.regressor[..., group, 0] > 0.0
    after = there[..., 1:] & there[..., :-1]
    power, following = np.moveaxis(state.power[..., group, :], -1, 0)
    usual = power / state.weight[..., group]
    # ρ, how much of a block's residual is that of the block before
    kept = np.where(after, np.clip(following / power, 0.0, LASTING)[..., None], 0.0)
    told = moved[..., 1:] - kept * moved[..., :-1]
    error = errors[..., 1:, group, 0] - kept * errors[..., :-1, group, 0]
    x = state.regressor[..., group, :]
    x = x[..., 1:, :] - kept[..., None] * x[..., :-1, :]
    unknown = np.einsum("...ki,...ij,...kj->...k", x, covariance[..., group, :, :], x)
    wide = TAILS * ((1.0 - kept**2) * usual[..., None] + unknown)
    odds = np.log1p((error + told) ** 2 / wide) - np.log1p((error - told) ** 2 / wide)
    return np.asarray((TAILS + 1.0) / 2.0 * np.where(there[..., 1:], odds, 0.0).sum(axis=-1))
