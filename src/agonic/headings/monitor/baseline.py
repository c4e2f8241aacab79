"""`State` of a monitor, and what it knows of the residuals while all is well."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.calibration.monitoring import (
    DIMENSIONS,
    KEPT,
    LENGTHS,
    MEMORY,
    NOISE_PRIOR,
    QUIET,
    TURNED,
    MonitorParams,
)

R, Q, S, V = range(4)
"""The groups of residuals: field, tilt, strength, vertical intensity."""


class Block(NamedTuple):
    """Means over the rows of a block: fields, nT, and down in body axes of each compass (…, 2, 3),
    strength less the expected (…, 2), and vertical intensity less that of such a strength at the
    dip to expect (…, 2), nT; and the level part of the field (…, 3) in its last row."""

    field: Array
    down: Array
    strength: Array
    vertical: Array
    level: Array


class State(NamedTuple):
    """What a monitor carries from block to block; any leading axes.

    `residual` (…, k, 4, 3) and `regressor` (…, k, 4, 4) of the last k blocks, the latter zero where
    a group has none, and `filled` (…,) how many there are. `information` (…, 4, 4, 4) and `seen`
    (…, 4, 4, 3) of the regressions, and what they give, `covariance` (…, 4, 4, 4) and coefficients
    `known` (…, 4, 4, 3). Sums of `square` (…, 4, 2) of window means and of `power`
    (…, 4, 2) of blocks, squares and products with the block before, over `weight` (…, 4). Of r and
    q, `since` (…, 2) blocks since a fault began, 0 without one, and the compass `named` (…, 2), 1
    or 2, 0 not yet. `level` (…, 3) part of the field at the end of the last block; `skipped` (…,)
    how many blocks were disturbed.
    """

    residual: Array
    regressor: Array
    filled: Index
    information: Array
    seen: Array
    covariance: Array
    known: Array
    square: Array
    power: Array
    weight: Array
    since: Index
    named: Index
    level: Array
    skipped: Index


def start(params: MonitorParams, shape: tuple[int, ...] = ()) -> State:
    """The state before the first block, of as many monitors as the shape says."""
    variance = np.array(params.noise_sd) ** 2
    pair = np.broadcast_to((NOISE_PRIOR * variance)[:, None], (*shape, 4, 2))
    return State(
        residual=np.zeros((*shape, KEPT, 4, 3)),
        regressor=np.zeros((*shape, KEPT, 4, 4)),
        filled=np.zeros(shape, dtype=np.intp),
        information=np.zeros((*shape, 4, 4, 4)),
        seen=np.zeros((*shape, 4, 4, 3)),
        covariance=np.zeros((*shape, 4, 4, 4)) + _find_prior(params, 1.0),
        known=np.zeros((*shape, 4, 4, 3)),
        square=pair.copy(),
        power=pair * [1.0, 0.0],
        weight=np.full((*shape, 4), float(NOISE_PRIOR)),
        since=np.zeros((*shape, 2), dtype=np.intp),
        named=np.zeros((*shape, 2), dtype=np.intp),
        level=np.zeros((*shape, 3)),
        skipped=np.zeros(shape, dtype=np.intp),
    )


def describe(block: Block, before: Array, params: MonitorParams) -> tuple[Array, Array]:
    """Residuals (…, 4, 3) and regressors (…, 4, 4) of a block, where the level field (…, 3)
    `before` was that of the end of the last one; none of v where the vehicle turned."""
    field, down = block.field.mean(axis=-2), block.down.mean(axis=-2)
    crossed = before[..., 0] * block.level[..., 1] - before[..., 1] * block.level[..., 0]
    turn = np.arctan2(crossed, (before * block.level).sum(axis=-1))
    residual = np.zeros((*field.shape[:-1], 4, 3))
    residual[..., R, :] = block.field[..., 0, :] - block.field[..., 1, :]
    residual[..., Q, :2] = (block.down[..., 0, :] - block.down[..., 1, :])[..., :2]
    residual[..., S, 0] = block.strength.mean(axis=-1)
    residual[..., V, 0] = block.vertical.mean(axis=-1)
    regressor = np.ones((*field.shape[:-1], 4, 4))
    level = field - (field * down).sum(axis=-1, keepdims=True) * down
    axes = (field / params.field, down, field / params.field, level / params.horizontal)
    for group, three in enumerate(axes):
        regressor[..., group, 1:] = three
    regressor[..., V, 3] = turn * regressor[..., V, 2]  # how turning at the usual speed leans
    straight = (np.abs(turn) < TURNED)[..., None]
    residual[..., V, :] *= straight
    regressor[..., V, :] *= straight
    return residual, regressor


def _find_prior(params: MonitorParams, sign: float) -> Array:
    """The covariance (4, 4, 4) of the regressions before any block, or for −1 its inverse."""
    return np.asarray(np.eye(4) * (np.array(params.prior_sd) ** (2 * sign))[:, None, None])


def learn(state: State, params: MonitorParams, rows: Mask) -> State:
    """The regressions with the oldest block that is kept, where `rows` (…,) say so; iron that was
    passed counts for no more than three standard deviations.

    Λ = Λ₀ + Σ λᵏ x xᵀ/σ²: what is forgotten falls back to the prior, so nothing winds up.
    """
    if not rows.any():
        return state
    sd2 = LENGTHS[1] * state.square[..., 1] / state.weight  # of a block among lasting errors
    x, y = state.regressor[..., 0, :, :], state.residual[..., 0, :, :]
    expected = np.einsum("...gi,...gid->...gd", x, state.known)
    error = y - expected
    most = QUIET * state.power[..., 0] / state.weight
    size = np.maximum(measure(error), 1e-30)
    y = expected + error * np.sqrt(np.minimum(1.0, most / size))[..., None]
    keep = 1.0 - 1.0 / MEMORY
    weighted = x / sd2[..., None]
    more = keep * state.information + weighted[..., :, None] * x[..., None, :]
    seen = keep * state.seen + weighted[..., :, None] * y[..., None, :]
    chosen = rows[..., None, None, None]
    more = np.where(chosen, more, state.information)
    seen = np.where(chosen, seen, state.seen)
    covariance = np.asarray(np.linalg.inv(more + _find_prior(params, -1.0)), dtype=np.float64)
    return state._replace(
        information=more, seen=seen, covariance=covariance, known=np.asarray(covariance @ seen)
    )


def measure(values: Array) -> Array:
    """Squares of residuals (…, 4, 3) per number, (…, 4)."""
    return np.asarray((values**2).sum(axis=-1) / np.array(DIMENSIONS))
