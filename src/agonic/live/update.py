"""One step of a live calibration: readings in, the next state out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.arrays import Array, Mask
from agonic.live.maths import voxels
from agonic.live.maths.voxels import Voxels
from agonic.live.quarantine import find_plausible, find_stray, judge_blocks
from agonic.live.state import OF_FIT, Found, LiveParams, LiveState
from agonic.live.track import extend_track
from agonic.maths.equation import moment_fit, moments

MAX_CONDITION = 1e6
"""The condition above which a fit is no judge: where little was seen it may lie at the end of a
long bent valley, far off and sure of itself."""

JUDGE_GROWTH = 1.1
"""The fit that readings are held against is made anew when there are so many times as many."""


def update_state(
    params: LiveParams, state: LiveState, rows: Array, motion: Array | None = None
) -> LiveState:
    """The state after rows (n, 4) of time and field, the same however they are cut in chunks. Rows
    that no sensor gives are left out and counted. A fit is made where the count of readings last
    passed a multiple of `params.every`."""
    good = np.isfinite(rows[:, 0]) & find_plausible(rows[:, 1:], params.unit)
    state = replace(state, rejected=state.rejected + int((~good).sum()))
    rows = rows[good]
    if motion is not None:
        state = replace(state, track=extend_track(state.track, rows, motion[good]))
    blocks = state.n // params.every
    while len(rows):
        until = _plan_next_judge(params, state)
        taken, rows = np.split(rows, [until - state.n])
        state = _take(params, state, taken)
        if state.n == until:
            state = _renew_judge(params, state)
    if state.n // params.every == blocks:
        return state
    found = _fit(params, state.n, collect_boxes(params, state), state.judge)
    return replace(state, found=found or state.found)


def collect_boxes(params: LiveParams, state: LiveState) -> Voxels | None:
    """The boxes with the readings that wait in them too, as long as nothing speaks against them."""
    waiting = state.waiting[: len(state.waiting) - state.n % params.every]
    return _put_in_boxes(state.voxels, waiting, params.every)[0]


def _plan_next_judge(params: LiveParams, state: LiveState) -> int:
    """The count of readings at which the next judge is made, a multiple of `every`."""
    blocks = max(
        int(JUDGE_GROWTH * state.judged_at / params.every), state.judged_at // params.every + 1
    )
    return blocks * params.every


def _renew_judge(params: LiveParams, state: LiveState) -> LiveState:
    """A judge of what was let in so far; none where as much was kept out, which is as credible."""
    boxes, judge = state.voxels, None
    if boxes is not None and 2 * state.held <= state.n and boxes.counts.sum() >= 100:
        judge = _fit(params, state.n, boxes, state.judge)
        if judge is not None and judge.condition > MAX_CONDITION:
            judge = None
    return replace(state, judge=judge, judged_at=state.n)


def _count_repeats(state: LiveState, field: Array) -> Array:
    """How often each axis has repeated itself up to now."""
    repeats, last = state.repeats.copy(), state.recent[-1:, 1:]
    steps = np.concatenate([last, field])
    for axis in range(3):
        changed = np.flatnonzero(np.diff(steps[:, axis]) != 0)
        total = len(steps) - 1
        repeats[axis] = total - 1 - changed[-1] if len(changed) else repeats[axis] + total
    return repeats


def _take(params: LiveParams, state: LiveState, rows: Array) -> LiveState:
    """Rows taken: whole blocks of them judged, and put in their boxes when they have waited."""
    partial = state.n % params.every
    judged, fresh = np.split(state.waiting, [len(state.waiting) - partial])
    fresh = np.concatenate([fresh, rows])
    fresh, partly = np.split(fresh, [len(fresh) - len(fresh) % params.every])
    made = judge_blocks(state.judge, state.alarm, state.off, judged, fresh, params.every)
    boxes, memorable = _put_in_boxes(state.voxels, made.let_in, params.every)
    return replace(
        state,
        n=state.n + len(rows),
        repeats=_count_repeats(state, rows[:, 1:]),
        recent=np.concatenate([state.recent, rows])[-25:],  # the present
        voxels=boxes,
        kept=np.concatenate([state.kept, made.let_in[memorable]]),
        waiting=np.concatenate([made.waiting, partly]),
        held=state.held + made.held,
        alarm=made.alarm,
        off=made.off,
    )


def _put_in_boxes(boxes: Voxels | None, rows: Array, every: int) -> tuple[Voxels | None, Mask]:
    """Boxes with rows put in, and which rows to remember; the first `every` set the edge."""
    if not len(rows):
        return boxes, np.zeros(0, dtype=bool)
    field = rows[:, 1:]
    if boxes is None:
        first = np.median(field[:every], axis=0)  # of several: the very first may be garbled
        boxes = voxels.begin(first, float(np.abs(first).max() or 1.0) * 2.0**-12)
    boxes, place = voxels.add_readings(boxes, field)
    return boxes, (place <= moment_fit.PLENTY) | (np.log2(place) % 1 == 0)


def _fit(params: LiveParams, n: int, boxes: Voxels | None, judge: Found | None) -> Found | None:
    """The fit to boxes, from the judge on."""
    if boxes is None or len(boxes.keys) < 5:  # no sphere goes through so few
        return None
    stray = find_stray(boxes.middles, boxes.counts)
    left_out = int(boxes.counts[stray].sum())
    boxes = boxes._replace(keys=boxes.keys[~stray], sums=boxes.sums[~stray])
    middles = boxes.middles
    centre = middles.mean(axis=0)
    size = float(np.linalg.norm(middles - centre) / np.sqrt(len(middles)))
    if not size > 0:
        return None
    sums = moments.rebase(boxes.sums.T, boxes.centre, boxes.scale, centre, size).T
    start = None
    if judge is not None:
        bias = (judge.centre + judge.size * judge.bias - centre) / size
        start = bias, judge.matrix * size / judge.size
    made = moment_fit.estimate(sums, params.soft_iron_sd, start)
    if made is None:
        return None
    of_fit = {name: getattr(made, name) for name in OF_FIT}
    return Found(n, centre, size, **of_fit, left_out=left_out)
