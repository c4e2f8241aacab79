"""One step of a live calibration: readings in, the next state out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from agonic.kernels import moments, summed, voxels
from agonic.live.state import Found, LiveParams, LiveState

Array = NDArray[np.float64]

RECENT = 25
"""Readings that count as the present."""

FEWEST_BOXES = 5
"""Boxes below which no sphere is laid through them."""

FINEST = 2.0**-12
"""Edge of the first boxes, over the largest reading: small enough to begin with."""


def updated(params: LiveParams, state: LiveState, rows: Array) -> LiveState:
    """The state after rows (n, 4) of time and field, the same however they are cut in chunks.

    A fit is made where the count of readings last passed a multiple of `params.every`.
    """
    finite = np.isfinite(rows).all(axis=1)
    state = replace(state, rejected=state.rejected + int((~finite).sum()))
    rows = rows[finite]
    after = (state.n + len(rows)) % params.every
    if after >= len(rows):
        return _put(state, rows)
    before = len(rows) - after
    return _put(_fitted(params, _put(state, rows[:before])), rows[before:])


def _repeated(state: LiveState, field: Array) -> LiveState:
    """How often each axis has repeated itself up to now."""
    repeats, last = state.repeats.copy(), state.recent[-1:, 1:]
    steps = np.concatenate([last, field])
    for axis in range(3):
        changed = np.flatnonzero(np.diff(steps[:, axis]) != 0)
        total = len(steps) - 1
        repeats[axis] = total - 1 - changed[-1] if len(changed) else repeats[axis] + total
    return replace(state, repeats=repeats)


def _put(state: LiveState, rows: Array) -> LiveState:
    """Rows put in their boxes; those to remember are kept."""
    if not len(rows):
        return state
    field = rows[:, 1:]
    boxes = state.voxels
    if boxes is None:
        boxes = voxels.begun(field[0], float(np.abs(field[0]).max() or 1.0) * FINEST)
    boxes, place = voxels.added(boxes, field)
    memorable = (place <= summed.PLENTY) | (np.log2(place) % 1 == 0)
    return replace(
        _repeated(state, field),
        n=state.n + len(rows),
        voxels=boxes,
        kept=np.concatenate([state.kept, rows[memorable]]),
        recent=np.concatenate([state.recent, rows])[-RECENT:],
    )


def _fitted(params: LiveParams, state: LiveState) -> LiveState:
    """The fit to all boxes so far."""
    boxes = state.voxels
    if boxes is None or len(boxes.keys) < FEWEST_BOXES:
        return state
    middles = boxes.middles
    centre = middles.mean(axis=0)
    size = float(np.linalg.norm(middles - centre) / np.sqrt(len(middles)))
    if not size > 0:
        return state
    sums = moments.rebase(boxes.sums.T, boxes.centre, boxes.scale, centre, size).T
    made = summed.estimate(sums, params.soft_iron_sd)
    if made is None:
        return state
    found = Found(
        state.n, centre, size, made.bias, made.matrix, made.covariance, made.noise, made.condition
    )
    return replace(state, found=found)
