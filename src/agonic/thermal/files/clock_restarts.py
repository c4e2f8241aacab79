"""Clocks that begin anew within a recording: a board that was reset, a logger that restarted."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Index

_NEAR = 5
"""Rows on each side that must agree, so that one damaged time is no restart."""
_MOST = 1000


def find_restarts(time: Array) -> Index:
    """The rows (k,) from which a clock runs on from an earlier time than the row before.

    >>> find_restarts(np.array([0.0, 1, 2, 3, 4, 5, 0, 1, 2, 3, 4, 5])).tolist()
    [6]
    >>> find_restarts(np.array([0.0, 1, 2, 0, 4, 5, 6, 7])).tolist()
    []
    """
    backward = np.flatnonzero(np.diff(time) < 0) + 1
    if len(backward) > _MOST:  # rows out of order, not a clock that restarts
        return np.zeros(0, dtype=np.intp)
    found = [at for at in backward if _runs_on(time[at - 1 :: -1][:_NEAR], time[at:][:_NEAR])]
    return np.array(found, dtype=np.intp)


def _runs_on(before: Array, after: Array) -> bool:
    """Whether the times before (backwards) and after a step each run forward, and lie apart."""
    forward = bool((np.diff(before) < 0).all() and (np.diff(after) > 0).all())
    enough = min(len(before), len(after)) >= 2
    return enough and forward and bool(np.median(after) < np.median(before))


def join_restarts(time: Array) -> tuple[Array, Index]:
    """The times with every restart set behind the row before it by one usual step, and its rows.

    How long the clock stood is not known; the step is the least it can be.

    >>> joined, rows = join_restarts(np.array([7.0, 8, 9, 10, 0, 1, 2, 3]))
    >>> joined.tolist(), rows.tolist()
    ([7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0], [4])
    """
    rows = find_restarts(time)
    if not len(rows):
        return time, rows
    step = float(np.median(np.diff(time)[np.diff(time) > 0]))
    joined = time.copy()
    for row in rows:
        joined[row:] += joined[row - 1] + step - joined[row]
    return joined, rows
