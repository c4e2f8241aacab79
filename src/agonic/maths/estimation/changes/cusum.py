"""Cumulative sums (CUSUM), two-sided: the moment from which on residuals lie off zero.

    S⁺ ← max(0, S⁺ + (z − k)/L),   S⁻ ← max(0, S⁻ − (z + k)/L)

with z a residual over its standard deviation, k half the smallest shift to be noticed, L the
correlation length, in residuals. A sum above h raises the alarm, and it began where that sum last
left zero (Page 1954). Of independent normal residuals one sum raises it falsely about every
e^{2k(h + 1.17)}/2k² readings (Siegmund 1985): with k = 1 and h = 10 every 2·10⁹.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index

CLIPPED = 4.0
"""No residual counts for more standard deviations than this, so that outliers do not alarm."""


class Sums(NamedTuple):
    """Sums upwards and downwards (2, o), and how many rows ago each last was zero (2, o)."""

    size: Array
    age: Index


def start_sums(channels: int) -> Sums:
    """Sums before the first reading."""
    return Sums(np.zeros((2, channels)), np.zeros((2, channels), dtype=np.intp))


class Step(NamedTuple):
    """The sums after the last row taken, how many rows were taken, and whether one alarmed."""

    sums: Sums
    rows: int
    alarmed: bool

    @property
    def age(self) -> int:
        """How many rows ago the sum that is largest began to rise."""
        return int(self.sums.age.ravel()[int(np.argmax(self.sums.size))])


def advance(
    sums: Sums, residuals: Array, *, drift: float, alarm: float, correlation: float = 1.0
) -> Step:
    """The sums after residuals (n, o) over their standard deviation, up to the first alarm.

    Parameters: `drift` k, `alarm` h, `correlation` L. An alarm of 0 is never raised."""
    n = len(residuals)
    clipped = np.clip(residuals, -CLIPPED, CLIPPED)
    steps = (np.stack([clipped, -clipped]) - drift) / correlation
    walk = sums.size[:, None] + np.cumsum(steps, axis=1)
    # reflected at zero: max(0, S + step) of every row is the walk less its least so far below zero
    least = np.minimum(np.minimum.accumulate(walk, axis=1), 0.0)
    size = walk - least
    above = (size > alarm).any(axis=(0, 2)) if alarm > 0 else np.zeros(n, dtype=bool)
    alarmed = bool(above.any())
    rows = int(np.argmax(above)) + 1 if alarmed else n
    return Step(Sums(size[:, rows - 1].copy(), _ages(sums.age, size[:, :rows])), rows, alarmed)


def _ages(before: Index, size: Array) -> Index:
    """How many rows ago each sum last was zero (2, o), of sums (2, n, o) after rows."""
    n = size.shape[1]
    zero = size == 0.0
    since = np.argmax(zero[:, ::-1], axis=1)
    return np.asarray(np.where(zero.any(axis=1), since, before + n), dtype=np.intp)
