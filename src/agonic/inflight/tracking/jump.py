"""Back to where a jump began: what is kept for it, and the state opened again from there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.calibration.tracking import Jump, Opening, Recent, TrackerParams, TrackerState
from agonic.inflight.tracking import opening as openings
from agonic.maths.estimation.filters import kalman, states


def settle_before_jump(state: TrackerState, params: TrackerParams, since: int) -> TrackerState:
    """The state as if its opening had settled before the last `since` readings, in which the bias
    jumped."""
    opening = state.opening
    assert opening is not None, "a settled state sees jumps by itself"
    rows = opening.rows[-since:]
    shorter = replace(opening, rows=opening.rows[:-since], outliers=None)
    settled = openings.solve_opening(replace(state, opening=shorter), params)
    params = settled.settle_params(params)
    model = params.model(settled.noise, jumps=False)
    estimate, seen, _ = kalman.advance(settled.estimate, model, rows)
    return replace(
        settled,
        estimate=estimate,
        noise_known=True,
        opening=None,
        recent=Recent(before=settled.estimate, middle=settled.estimate, rows=rows),
        refused=settled.refused + int((~seen.used).sum()),
    )


def reopen(state: TrackerState, params: TrackerParams) -> TrackerState:
    """The state after a jump was seen: back to where it began, and opened from there."""
    recent, given = state.recent, params
    assert recent is not None, "only a settled state sees jumps"
    params = state.settle_params(params)
    model = params.model(state.noise, jumps=False)
    _, seen, _ = kalman.advance(recent.before, model, recent.rows)
    first = _find_onset(state, params, model, seen)
    since = recent.rows[first:]
    jump = Jump(
        time=float(since[0, 0]),
        seen=float(since[-1, 0]),
        shift=np.zeros(3),
        shift_sd=np.full(3, params.jump_sd),
    )
    opened = replace(
        _open(state, params, model, first),
        refused=max(state.refused - int((~seen.used[first:]).sum()), 0),
        jumps=(*state.jumps, jump),
    )
    return openings.solve_opening(opened, given) if len(since) >= openings.MOMENTS[0] else opened


def find_onset(seen: kalman.Predictions) -> int:
    """The row at which a jump began: where the test over all rows after it is largest.

    Source: the generalised likelihood ratio of Willsky and Jones (1976), over the onset.
    """
    w, z = seen.shown[::-1, 1:4], seen.innovation[::-1]
    information = np.cumsum(w[:, :, None] * w[:, None, :], axis=0) + 1e-12 * np.eye(3)
    score = np.cumsum(w * z[:, None], axis=0)
    statistic = np.einsum("ki,kij,kj->k", score, np.linalg.pinv(information), score)
    return len(z) - 1 - int(np.argmax(statistic))


def _find_onset(
    state: TrackerState, params: TrackerParams, model: states.Model, seen: kalman.Predictions
) -> int:
    """The row at which a jump began: by the test, or among the last rows, whichever fits better."""
    assert state.recent is not None, "only a settled state has recent readings"
    rows = state.recent.rows
    guesses = [find_onset(seen), max(len(rows) - openings.MOMENTS[0], 0)]
    tried: dict[int, float] = {}
    # most searches end after four
    while guesses and len(tried) < 8:
        guess = guesses.pop(0)
        if guess not in tried:
            opened = _open(state, params, model, guess)
            tried[guess], better = openings.date_jump(opened, params, seen, rows)
            guesses.append(better)
    least = min(tried.values())
    return max(row for row, cost in tried.items() if cost < least + openings.DOUBT)


def _open(
    state: TrackerState, params: TrackerParams, model: states.Model, first: int
) -> TrackerState:
    """The state opened at one of its recent readings, with what the bias may have jumped by."""
    recent = state.recent
    assert recent is not None, "only a settled state has recent readings"
    before, since = recent.rows[:first], recent.rows[first:]
    estimate = kalman.advance(recent.before, model, before)[0] if first else recent.before
    _, seen, _ = kalman.advance(estimate, model, since)
    gain = float(np.mean(estimate.state[4:7]))
    size = 2 * float(np.median(np.abs(seen.residual))) / gain
    prior = states.widen_for_jump(estimate, max(params.jump_sd, size))
    return replace(
        state,
        estimate=kalman.advance(prior, model, since)[0],
        opening=Opening(prior=prior, rows=since, before=estimate),
        recent=None,
    )
