"""Readings while nothing moved: means over stretches, with a reference read at the same moments.

All relations between the instruments are linear in the means of a stretch, so nothing is lost by
them, whatever the rates of the instruments.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index, Mask


class Stretches(NamedTuple):
    """Means of k stretches: time (k,), field (k, 3) and reference (k, 3), and counts (k,).

    `scatter`, `reference_scatter` are standard deviations of one reading on an axis within the
    stretches, NaN where too few tell; `reference_share` (k,) is that of the mean of the reference
    over that of one reading: interpolated readings share neighbours.
    """

    time: Array
    field: Array
    counts: NDArray[np.int64]
    scatter: float
    reference: Array
    reference_share: Array
    reference_scatter: float


def split(changed: Mask) -> list[Index]:
    """The rows between changes (n − 1,) from one reading to the next.

    >>> [rows.tolist() for rows in split(np.array([False, True]))]
    [[0, 1], [2]]
    """
    return np.split(np.arange(len(changed) + 1), np.flatnonzero(changed) + 1)


def find_rows(numbers: NDArray[np.int64] | Array, wanted: NDArray[np.int64]) -> list[Index]:
    """The rows of each wanted number."""
    return [np.flatnonzero(numbers == number) for number in wanted]


def average(values: Array, rows: list[Index]) -> Array:
    """Means (k, …) of values (n, …) over the rows of each stretch."""
    counts = np.array([len(own) for own in rows])
    sums = sum_each(values, rows)
    return np.asarray(sums / counts.reshape(-1, *[1] * (sums.ndim - 1)))


def sum_each(values: Array, rows: list[Index]) -> Array:
    """Sums (k, …) of values (n, …) over the rows of each stretch."""
    first = np.cumsum([0, *(len(own) for own in rows[:-1])])
    return np.asarray(np.add.reduceat(values[np.concatenate(rows)], first, axis=0))


def average_stretches(
    rows: list[Index], time: Array, field: Array, reference_time: Array, reference: Array
) -> Stretches:
    """The table of stretches of readings (n, 3) beside those of a reference (m, 3).

    The reference is interpolated linearly in time at each reading.
    """
    parts = [_find_weights(time[own], reference_time) for own in rows]
    return Stretches(
        time=average(time, rows),
        field=average(field, rows),
        counts=np.array([len(own) for own in rows]),
        scatter=find_scatter([(time[own], field[own]) for own in rows]),
        reference=np.array([weights @ reference[at] for at, weights in parts]),
        reference_share=np.array([float(np.sqrt((w**2).sum())) for _, w in parts]),
        reference_scatter=find_scatter([(reference_time[at], reference[at]) for at, _ in parts]),
    )


def _find_weights(time: Array, known: Array) -> tuple[Index, Array]:
    """Rows of the known times and their weights in the mean of linear interpolations at `time`."""
    right = np.clip(np.searchsorted(known, time), 1, max(len(known) - 1, 1))
    if len(known) == 1:
        return np.zeros(1, dtype=np.intp), np.ones(1)
    share = (time - known[right - 1]) / (known[right] - known[right - 1])
    share = np.clip(share, 0.0, 1.0)
    rows, at = np.unique(np.concatenate([right - 1, right]), return_inverse=True)
    weights = np.bincount(at, np.concatenate([1 - share, share])) / len(time)
    used = weights > 0
    return rows[used], weights[used]


def find_scatter(parts: list[tuple[Array, Array]]) -> float:
    """Standard deviation of one reading on one axis about straight lines in time, pooled."""
    squares, freedom = 0.0, 0
    for time, values in parts:
        if len(time) < 4:
            continue
        along = np.stack([np.ones(len(time)), time - time.mean()], axis=1)
        left = values - along @ np.linalg.lstsq(along, values, rcond=None)[0]
        squares += float((left**2).sum())
        freedom += 3 * (len(time) - 2)
    return float(np.sqrt(squares / freedom)) if freedom >= 6 else float("nan")
