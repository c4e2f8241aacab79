"""Rows put together to moments, and the heading that the gyro carries from one to the next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from agonic.arrays import Array, Index, Mask
from agonic.headings.gyro import GAP_S, LONGEST_STEP_S
from agonic.headings.maths.gyro_heading import GyroHeading, carry_heading
from agonic.maths.one_pass import interpolate

MOST = 20_000
"""Moments of a log."""
FEWEST = 50
"""Moments without which nothing is smoothed."""


class Moments(NamedTuple):
    """The `rows` (m,) of a log that the gyro carries a heading over, in N groups: the `start` (N,)
    of each among the rows and how many there are; its mean time, and `joined` (N − 1,), false over
    a pause."""

    rows: Index
    start: Index
    size: Array
    time: Array
    joined: Mask

    @property
    def middle(self) -> Index:
        """The place of a row of each moment among the rows."""
        return np.asarray(self.start + self.size.astype(np.intp) // 2)

    @property
    def cuts(self) -> Index:
        """The first moments after pauses."""
        return np.flatnonzero(~self.joined) + 1

    def add(self, values: Array) -> Array:
        """The sums over the rows (m, …) of each moment."""
        return np.asarray(np.add.reduceat(values, self.start, axis=0))

    def average(self, values: Array) -> Array:
        """The mean over the rows (m, …) of each moment."""
        return self.add(values) / self.size.reshape(-1, *[1] * (values.ndim - 1))

    def smooth(self, values: Array, duration_s: float) -> Array:
        """Moving averages of values (N, …) of the moments, never over a pause."""
        step = float(np.median(np.diff(self.time)))
        width = max(round(duration_s / step), 1)
        parts = np.split(values, self.cuts)
        return np.concatenate([uniform_filter1d(one, width, axis=0) for one in parts])

    def interpolate(self, time: Array, values: Array) -> Array:
        """Values (N,) of the moments at the times of the rows (m,), never over a pause."""
        found = [
            np.interp(at, own, one)
            for at, own, one in zip(
                np.split(time[self.rows], self.start[self.cuts]),
                np.split(self.time, self.cuts),
                np.split(values, self.cuts),
                strict=True,
            )
        ]
        return np.concatenate(found)


def put_together(time: Array, known: Mask) -> Moments | None:
    """The rows whose tilt is known as moments; `None` where there are too few."""
    rows = np.flatnonzero(known)
    if len(rows) < FEWEST:
        return None
    local = time[rows]
    paused = np.diff(local) > GAP_S
    spacing = max(0.1, float(local[-1] - local[0]) / MOST)
    cell = np.floor((local - local[0]) / spacing)
    start = np.flatnonzero(np.concatenate([[True], (np.diff(cell) > 0) | paused]))
    if len(start) < FEWEST:
        return None
    count = np.diff(np.append(start, len(rows))).astype(np.float64)
    middle = np.add.reduceat(local, start) / count
    return Moments(rows, start, count, middle, ~paused[start[1:] - 1])


def carry(time: Array, rate: Array, level: Array, moments: Moments) -> GyroHeading:
    """The gyro's heading of the rows (m,), from zero after each pause.

    Parameters: of all rows of the log, time (n,), rates (n, 3) and turns (n, 3, 3) to level axes.
    """
    found = []
    step = float(np.median(np.diff(time)))
    if step <= LONGEST_STEP_S:
        # a fast unit tells the mean over the step up to its row, as the filter of the tilt has it
        rate = interpolate(time + step / 2, time, rate)
    for rows in np.split(moments.rows, moments.start[moments.cuts]):
        if len(rows) > 1:
            found.append(carry_heading(time[rows], rate[rows], level[rows]))
        else:
            found.append(GyroHeading(np.zeros(1), np.zeros((1, 3)), np.zeros((1, 6))))
    return GyroHeading(*(np.concatenate(column) for column in zip(*found, strict=True)))
