"""Rows in the order of their times: turned round, sorted, or put in line after a restart.

Times must increase, and what does not would be left out. A table may be written newest first, by
several threads a few rows out of order, by a counter that wraps, or by a logger that starts again
and counts from zero.
"""

from __future__ import annotations

from bisect import bisect_right

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.logs.headers.quantities import DOCUMENT
from agonic.logs.rows.auxiliary import find_misplaced

_SHARE = 0.01
"""Share of the rows at which a clock may begin anew; more often it is broken."""
_LEAST = 10
"""Rows that a part after a restart has at least."""


def order_rows(time: Array) -> tuple[Index | None, tuple[str, ...]]:
    """The rows (k,) of a table in the order of their times (n,), and a note; `None` as they are.
    Nine tenths of the steps lead back in a table written newest first; threads put rows out of
    order by up to 20, or a tenth of a short table."""
    known = np.flatnonzero(np.isfinite(time))
    steps = np.diff(time[known])
    back = int((steps < 0).sum())
    if not back:
        return None, ()
    if back > 0.9 * np.count_nonzero(steps) and len(known) > 2:
        note = "the table is written newest first: its rows are reversed"
        return np.arange(len(time))[::-1], (note,)
    near = min(20, len(known) // 10)
    far = np.abs(_rank(time[known]) - np.arange(len(known))) > near
    kept = known[~(far & find_misplaced(time[known]))]
    moved = _rank(time[kept]) - np.arange(len(kept))
    if not moved.any() or np.abs(moved).max() > near:
        return None, ()
    order = np.arange(len(time))
    order[kept] = kept[np.argsort(time[kept], kind="stable")]
    return order, (f"{np.count_nonzero(moved)} rows were not in the order of their times: sorted",)


def _rank(values: Array) -> Index:
    """The place of each value in their order."""
    ranks = np.empty(len(values), np.int64)
    ranks[np.argsort(values, kind="stable")] = np.arange(len(values))
    return ranks


def find_strays(time: Array) -> Mask:
    """The few rows (n,) whose times are damaged: without them the others are in order. Those in no
    longest sequence of times that do not fall, where they are a hundredth of the rows or ten, and
    the others leave half of the time that they took: where the clock stepped back, the times on
    both sides are right and leave none."""
    known = np.flatnonzero(np.isfinite(time))
    t = time[known]
    kept = _longest_rise(t)
    strays = np.zeros(len(time), dtype=bool)
    if len(t) - len(kept) > max(_SHARE * len(t), _LEAST) or len(kept) < 2 * _LEAST:
        return strays
    missing, spans = np.diff(kept) - 1, np.diff(t[kept])
    if (spans < 0.5 * missing * np.median(spans)).any():
        return strays
    strays[np.delete(known, kept)] = True
    return strays


def _longest_rise(values: Array) -> Index:
    """The places of the longest sequence in which none is less than the one before it. Source:
    Fredman 1975, by patience sorting."""
    tails: list[float] = []
    ends: list[int] = []
    before = np.full(len(values), -1)
    for i, value in enumerate(values.tolist()):
        length = bisect_right(tails, value)
        before[i] = ends[length - 1] if length else -1
        tails[length : length + 1] = [value]
        ends[length : length + 1] = [i]
    chain = []
    at = ends[-1] if ends else -1
    while at >= 0:
        chain.append(at)
        at = int(before[at])
    return np.array(chain[::-1], dtype=np.int64)


def continue_time(time: Array, field: Array) -> tuple[Array, tuple[str, ...]]:
    """Times (n,) that go on where the clock begins anew or wraps, and a note. Rows that repeat
    earlier ones, time and reading (n, 3), stay behind and are left out later."""
    known = np.flatnonzero(np.isfinite(time))
    t = time[known]
    backward = np.flatnonzero(np.diff(t) < 0) + 1
    if not len(backward) or len(backward) > max(_SHARE * len(t), 1):
        return time, ()
    rows = np.column_stack([t, field[known]])
    _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    unique = first[which.ravel()] == np.arange(len(rows))
    if not unique.all():
        known = known[unique]
        t = time[known]
        backward = np.flatnonzero(np.diff(t) < 0) + 1
        if not len(backward):
            return time, ()
    ends = np.append(backward[1:], len(t))
    if (ends - backward).min() < _LEAST or backward[0] < _LEAST:
        return time, ()
    steps = np.diff(t)
    step = float(np.median(steps[steps > 0]))
    later = np.zeros(len(t))
    wraps, wrapping = [], DOCUMENT["wraps"]
    for at in backward:
        fall = float(t[at - 1] - t[at])
        found = (
            n for n, size in wrapping.items() if 0 < size - fall <= max(20 * step, 1e-3 * size)
        )
        wraps.append(next(found, ""))  # the counter whose wrap explains it
        later[at:] += wrapping.get(wraps[-1], fall + step)
    placed = time.copy()
    placed[known] = t + later
    if len(set(wraps)) == 1 and wraps[0]:
        return placed, (f"the clock has {wraps[0]} and wraps: it is counted up",)
    times = "once" if len(wraps) == 1 else f"{len(wraps)} times"
    return placed, (
        f"the clock starts again {times}: it is continued after one step; how long the log was "
        "interrupted is not known",
    )
