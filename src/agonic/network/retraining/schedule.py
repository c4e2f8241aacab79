"""When a retraining is due, and what of the readings is kept for it."""

from __future__ import annotations

from dataclasses import replace
from math import ceil
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.network import Network
from agonic.calibration.retraining import (
    MAX_RETRAININGS,
    RetrainerParams,
    RetrainerState,
    Retraining,
    Running,
    Why,
    Window,
)
from agonic.maths.estimation.changes import cusum

TELLING = 100
"""Readings before an alarm from which on they say how long residuals last."""


class Due(NamedTuple):
    """The row after which something is due, and why."""

    row: int
    why: Why


def find_due(state: RetrainerState, params: RetrainerParams, time: Array) -> Due | None:
    """The first of rows at `time` (n,) after which a retraining is due, if one is.

    Short of a change nothing is trained on less than a whole window: what runs knows more.
    """
    why: Why = "period"
    full = state.since_n + params.window_n - state.n - 1
    if params.window_s is not None:  # the row with which the window is as long as it may get
        full = min(full, int(np.searchsorted(time, state.since_time + params.window_s)))
    if state.onset is not None:
        why, row = "change", state.onset + state.wait - state.n - 1
    elif state.early:
        row = full
    elif state.settling is not None:
        why, row = "settling", min(state.since_n + state.settling - state.n - 1, full)
    else:
        by_time = int(np.searchsorted(time, state.due_time))
        row = int(max(min(state.due_n - state.n - 1, by_time), full))
    row = max(row, 0)
    return Due(row, why) if row < len(time) else None


def is_full(state: RetrainerState, params: RetrainerParams) -> bool:
    """Whether the window is as long as it may get."""
    by_time = params.window_s is not None and state.time >= state.since_time + params.window_s
    return by_time or state.n - state.since_n >= params.window_n


def take_rows(state: RetrainerState, params: RetrainerParams, rows: Window) -> RetrainerState:
    """The state after rows that were seen, without those that are too old."""
    window = state.window.with_rows(rows)
    n, time = state.n + len(rows), float(rows.time[-1])
    start = max(len(window) - params.window_n, 0)
    if params.window_s is not None:
        start = max(start, int(np.searchsorted(window.time, time - params.window_s)))
    if start:
        window = window.select(slice(start, None))
    onset = None if state.onset is None else max(state.onset, n - len(window))
    return replace(state, window=window, n=n, time=time, onset=onset)


def start(running: Running | None, params: RetrainerParams) -> RetrainerState:
    """The state before any reading, with what corrects at the start, if anything does."""
    channels = 3 if params.target == "vector" else 1
    nothing = Window(time=np.empty(0), raw=np.empty((0, 3)), wanted=np.empty((0, channels)))
    ends = () if running is None else ("sensor", "frame_in", "frame_out", "device_id")
    return RetrainerState(
        running=running,
        window=nothing,
        reservoir=nothing,
        watch=cusum.start_sums(channels),
        wait=params.fewest,
        noise=running.noise if isinstance(running, Network) else None,
        unit="nT" if running is None else running.unit_in,
        **{name: getattr(running, name) for name in ends},
    )


def begin(state: RetrainerState, params: RetrainerParams, time: float) -> RetrainerState:
    """The state before its first reading, at `time` s: periods count from there."""
    state = reschedule(replace(state, time=time, since_time=time), params)
    return replace(state, time=-np.inf)


def reschedule(state: RetrainerState, params: RetrainerParams) -> RetrainerState:
    """The state with the next periodical retraining a period from now."""
    every_n, every_s = params.every_n, params.every_s
    if every_n is None and every_s is None:
        every_n, every_s = (
            (params.window_n, None) if params.window_s is None else (None, params.window_s)
        )
    return replace(
        state,
        due_n=np.inf if every_n is None else state.n + every_n,
        due_time=np.inf if every_s is None else state.time + every_s,
    )


def discount_alarm(state: RetrainerState, correlation: float) -> RetrainerState:
    """The state after an alarm, with the correlation of the residuals before it: where they last
    longer than was known, the sums count for less, and it may have been none."""
    if correlation <= state.correlation:
        return state
    size = state.watch.size * (state.correlation / correlation)
    return replace(state, correlation=correlation, watch=state.watch._replace(size=size))


def close_retraining(
    state: RetrainerState, params: RetrainerParams, done: Retraining
) -> RetrainerState:
    """The state after a retraining: readings from before an accepted change are dropped, and it is
    learned again as the window fills; a poisoned stretch is dropped, and the next one waited out
    twice as long."""
    window, wait, has_changed = state.window, params.fewest, done.onset is not None
    if has_changed and done.poisoned:
        assert state.onset is not None
        window = window.select(slice(0, state.onset - state.first))
        wait = min(2 * state.wait, params.window_n)
    elif has_changed and done.accepted:
        assert state.onset is not None
        window = window.select(slice(state.onset - state.first, None))
        state = replace(state, since_n=state.onset, since_time=float(window.time[0]))
    learning = done.why == "settling" or (done.accepted and has_changed)
    settling = None
    if learning and not done.poisoned and not is_full(state, params):
        # a change that was learned is learned again with so many times the readings, until the
        # window is full: what few readings showed of it need not hold for the next ones
        settling = ceil(1.25 * (state.n - state.since_n))
    return reschedule(
        replace(
            state,
            window=window,
            wait=wait,
            settling=settling,
            onset=None,
            early=False,
            watch=cusum.start_sums(state.window.wanted.shape[1]),
            retrainings=(*state.retrainings, done)[-MAX_RETRAININGS:],
            accepted=state.accepted + done.accepted,
            rejected=state.rejected + (not done.accepted),
        ),
        params,
    )
