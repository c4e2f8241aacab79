"""The stretches of a recording during which a sensor stands still."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Mask

WINDOW_S, LEAST_S, TRIM_S = 0.5, 1.0, 0.2
STILL = 3.0
"""Scatter, in units of that of the stillest part, up to which a sensor stands still."""
_STILLEST = 0.05


def find_rest(time: Array, *columns: Array) -> NDArray[np.int64]:
    """The number of the static stretch that each row belongs to, (n,); −1 for none.

    In a running window of half a second no column (n, 3) may scatter more than three times as much
    as in its stillest twentieth. A stretch lasts at least a second; its ends are left out.
    """
    n = len(time)
    rate = (n - 1) / max(float(time[-1] - time[0]), 1e-9)
    width = int(np.clip(round(WINDOW_S * rate), 3, max(n, 3)))
    if n < 2 * width:
        return np.full(n, -1)
    rest = np.ones(n, dtype=bool)
    for column in columns:
        scatter = _running_sd(column, width)
        least = max(float(np.quantile(scatter, _STILLEST)), 1e-6 * float(np.abs(column).max()))
        rest &= scatter <= STILL * least
    return _number_runs(rest, time)


def _running_sd(values: Array, width: int) -> Array:
    """Standard deviation (n,), all axes together, in a window about each row."""
    centred = values - values.mean(axis=0)
    sums = np.cumsum(np.vstack([np.zeros((1, 3)), centred]), axis=0)
    squares = np.cumsum(np.concatenate([[0.0], (centred**2).sum(axis=1)]))
    first = np.clip(np.arange(len(values)) - width // 2, 0, len(values) - width)
    mean = (sums[first + width] - sums[first]) / width
    variance = (squares[first + width] - squares[first]) / width - (mean**2).sum(axis=1)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _number_runs(rest: Mask, time: Array) -> NDArray[np.int64]:
    """Runs of rest by number, the short ones and the ends of the others left out."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], rest.astype(np.int8), [0]])))
    number = np.full(len(rest), -1)
    count = 0
    for begin, end in edges.reshape(-1, 2):
        if time[end - 1] - time[begin] < LEAST_S:
            continue
        own = np.arange(begin, end)
        inside = (time[own] - time[begin] >= TRIM_S) & (time[end - 1] - time[own] >= TRIM_S)
        number[own[inside]] = count
        count += 1
    return number
