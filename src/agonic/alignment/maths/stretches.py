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
    """Means of k stretches: time (k,), field (k, 3), and counts (k,).

    `scatter` (3,) is the standard deviation of one reading on each axis within the stretches, NaN
    where too few tell. `beside` is the table of a reference at the same moments.
    """

    time: Array
    field: Array
    counts: NDArray[np.int64]
    scatter: Array
    beside: Beside | None = None

    @property
    def weight(self) -> Array:
        """Square roots of the weights (k, 1) of the means, 1 for one of the usual count."""
        return np.asarray(np.sqrt(self.counts / self.counts.mean())[:, None])

    def select(self, rows: slice) -> Stretches:
        """Some of the stretches."""
        beside = self.beside
        return self._replace(
            time=self.time[rows],
            field=self.field[rows],
            counts=self.counts[rows],
            beside=beside and beside._replace(field=beside.field[rows], share=beside.share[rows]),
        )


class Beside(NamedTuple):
    """Means (k, 3) of a reference at the moments of the readings, and its scatter (3,).

    `share` (k,) is the standard deviation of a mean over that of one reading: neighbours that are
    interpolated are shared.
    """

    field: Array
    share: Array
    scatter: Array


def split(changed: Mask) -> list[Index]:
    """The rows between changes (n − 1,) from one reading to the next.

    >>> [rows.tolist() for rows in split(np.array([False, True]))]
    [[0, 1], [2]]
    """
    return np.split(np.arange(len(changed) + 1), np.flatnonzero(changed) + 1)


def find_rows(numbers: NDArray[np.int64] | Array, wanted: NDArray[np.int64]) -> list[Index]:
    """The rows of each wanted number, in order.

    >>> [rows.tolist() for rows in find_rows(np.array([2, 1, 2]), np.array([1, 2, 3]))]
    [[1], [0, 2], []]
    """
    order = np.argsort(numbers, kind="stable")
    first, last = (np.searchsorted(numbers[order], wanted, side) for side in ("left", "right"))
    return [order[begin:end] for begin, end in zip(first, last, strict=True)]


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
    rows: list[Index], time: Array, field: Array, reference: tuple[Array, Array] | None = None
) -> Stretches:
    """The table of stretches of readings (n, 3), beside times and field (m, 3) of a reference.

    The reference is interpolated linearly in time at each reading.
    """
    made = Stretches(
        time=average(time, rows),
        field=average(field, rows),
        counts=np.array([len(own) for own in rows]),
        scatter=_find_scatter([(time[own], field[own]) for own in rows]),
    )
    if reference is None:
        return made
    read, other = reference
    parts = [_find_weights(time[own], read) for own in rows]
    beside = Beside(
        field=np.array([weights @ other[at] for at, weights in parts]),
        share=np.array([float(np.sqrt((weights**2).sum())) for _, weights in parts]),
        scatter=_find_scatter([(read[at], other[at]) for at, _ in parts]),
    )
    return made._replace(beside=beside)


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


def _find_scatter(parts: list[tuple[Array, Array]]) -> Array:
    """Standard deviations (3,) of one reading about straight lines in time, pooled."""
    squares, freedom = np.zeros(3), 0
    for time, values in parts:
        if len(time) < 3:
            continue
        along = np.stack([np.ones(len(time)), time - time.mean()], axis=1)
        left = values - along @ np.linalg.lstsq(along, values, rcond=None)[0]
        squares += (left**2).sum(axis=0)
        freedom += len(time) - 2
    return np.sqrt(squares / freedom) if freedom >= 2 else np.full(3, np.nan)
