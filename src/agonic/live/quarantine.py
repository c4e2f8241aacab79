"""Readings that do not count: those that no magnetometer gives, and those made near iron.

The former are left out at the door, before they can spoil a sum. The others wait before they are
let in, for near iron is noticed only when it is already near.
Blocks of readings are compared with the fit to those before them. A block that is off it is kept
out, and so is all that came within `WAIT_S` before and after it, when the iron was further off.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.live.state import Found
from agonic.maths.equation import moment_fit
from agonic.units import RAW

WAIT_S = 1.5
"""How long readings wait, and for how long after a disturbance none are let in."""


NOISE_SDS = 4.0
"""Standard deviations of the readings by which a block must be off."""

FIT_SDS = 10.0
"""Standard errors of the fit by which it must: where it has seen little, it is not the judge."""


class Judgement(NamedTuple):
    """Rows let in, rows that wait, how many are kept out; the time, s, of the last block that was
    off, and by how much of the magnitude."""

    let_in: Array
    waiting: Array
    held: int
    alarm: float
    off: float


def compute_deviations(judge: Found | None, blocks: Array) -> Array:
    """By how much of the magnitude blocks (b, k, 4) of rows are off, 0 where they are not, (b,)."""
    if judge is None:
        return np.zeros(len(blocks))
    points = (blocks[:, :, 1:].reshape(-1, 3) - judge.centre) / judge.size
    off, sd = moment_fit.compute_deviations(points, judge.bias, judge.matrix, judge.covariance)
    noise = judge.noise * float(np.trace(judge.matrix)) / 3
    room = np.median(np.hypot(FIT_SDS * sd, NOISE_SDS * noise).reshape(blocks.shape[:2]), axis=1)
    middle = np.median(off.reshape(blocks.shape[:2]), axis=1)
    return np.where(np.abs(middle) > np.maximum(0.015, room), middle, 0.0)  # of the field


def judge_blocks(
    judge: Found | None, alarm: float, last: float, waiting: Array, fresh: Array, size: int
) -> Judgement:
    """Whole blocks of `size` among rows that wait and `fresh` ones (…, 4), one after another;
    `alarm` is the time of the last that was off, by `last`.

    The rows that wait have been judged before. What is let in does not depend on how the readings
    were cut in chunks, as long as the judge is the same.
    """
    rows = np.concatenate([waiting, fresh])
    blocks = rows.reshape(-1, size, 4)
    old = len(waiting) // size
    off = compute_deviations(judge, blocks[old:])
    begins, ends = blocks[:, 0, 0].tolist(), blocks[:, -1, 0].tolist()
    queue, let_in, held = deque(range(old)), list[int](), 0
    for k in range(old, len(blocks)):
        while queue and (abs(begins[k] - begins[queue[0]]) > WAIT_S or len(queue) * size >= 2000):
            let_in.append(queue.popleft())
        if off[k - old]:
            held += 1 + len(queue)
            queue.clear()
            alarm, last = ends[k], float(off[k - old])
        elif abs(begins[k] - alarm) < WAIT_S:
            held += 1
        else:
            queue.append(k)
    chosen = blocks[let_in].reshape(-1, 4)
    return Judgement(chosen, blocks[list(queue)].reshape(-1, 4), held * size, alarm, last)


LARGEST_nT = 1e8
"""0.1 T: beyond the range of every magnetometer, Hall sensors included."""


FAR_DISTANCES = 3.0
"""Times the usual distance from the midst of all boxes; a whole sphere is at one, an arc below
two."""

STRAY_SHARE = 0.02
"""Of the readings: more that lie far off are no stray ones."""


def find_plausible(field: Array, unit: str) -> Mask:
    """Which readings (n, 3), in nT or raw counts, a sensor can have given: finite, within what any
    measures, and not exactly zero on all axes, which is a sensor that has not begun."""
    largest = 2.0**31 if unit == RAW else LARGEST_nT
    with np.errstate(invalid="ignore"):
        return np.asarray((np.abs(field) < largest).all(axis=1) & (field != 0).any(axis=1))


def find_stray(middles: Array, counts: Array) -> Mask:
    """Which boxes (k,) lie far from all others and hold few readings: garbled numbers and spikes. A
    fit by moments begins at the best sphere through all of them, which a single reading ten times
    as far as the others would carry away."""
    distance = np.linalg.norm(middles - np.median(middles, axis=0), axis=1)
    far = distance > FAR_DISTANCES * np.median(distance)
    few = counts[far].sum() <= max(STRAY_SHARE * counts.sum(), 2)
    return np.asarray(far & few)
