"""Moments and stretches of a log in words: by its clock, or by rows where it has none."""

from __future__ import annotations

from agonic.arrays import Array, Index

MOST = 6
"""Moments and stretches that are named; of more, the first or the longest."""


def describe_moments(rows: Index, time: Array | None) -> str:
    """The moments of rows (k,) in words, by `time` (n,), the log's clock.

    >>> import numpy as np
    >>> describe_moments(np.array([2, 5]), 10.0 + np.arange(8.0))
    'near t = 12.0 s and t = 15.0 s'
    >>> describe_moments(np.array([2]), None)
    'near row 2'
    """
    if not len(rows):
        return "for all of the log but its ends"
    named = [f"row {row}" if time is None else f"t = {time[row]:.1f} s" for row in rows[:MOST]]
    if len(rows) > MOST:
        return f"near {', '.join(named)} and {len(rows) - MOST} more times"
    return f"near {', '.join(named[:-1])}{' and ' if len(named) > 1 else ''}{named[-1]}"


def describe_stretches(stretches: Index, time: Array | None) -> str:
    """Stretches (k, 2), first row and last, in words; the longest where there are many.

    >>> import numpy as np
    >>> describe_stretches(np.array([[2, 5], [6, 7]]), 10.0 + np.arange(8.0))
    'from t = 12.0 s to 15.0 s and from 16.0 s to 17.0 s'
    >>> describe_stretches(np.array([[2, 5]]), None)
    'from row 2 to 5'
    """
    longest = (stretches[:, 0] - stretches[:, 1]).argsort(kind="stable")[:MOST]
    named = list[str]()
    for k in sorted(longest):
        first, last = stretches[k]
        if time is None:
            ends = f"{'row ' if not named else ''}{first} to {last}"
        else:
            ends = f"{'t = ' if not named else ''}{time[first]:.1f} s to {time[last]:.1f} s"
        named.append(f"from {ends}")
    if len(stretches) > MOST:
        return f"{', '.join(named)} and {len(stretches) - MOST} times more"
    return ", ".join(named[:-1]) + (" and " if len(named) > 1 else "") + named[-1]
