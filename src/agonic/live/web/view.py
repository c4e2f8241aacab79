"""The readings that a page shows: the last ones of a sensor, in a ring."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array

MOST = 50_000
"""Points of a sensor on the page."""


class RecentReadings:
    """The last `most` readings, and how many there were; `at` is when the latest came."""

    def __init__(self, most: int = MOST) -> None:
        self._ring = np.zeros((most, 3), np.float32)
        self.total, self.at = 0, 0.0

    def add(self, rows: Array, at: float) -> None:
        """Put readings (n, 3) in."""
        rows = rows[np.isfinite(rows).all(axis=1)]
        total = self.total + len(rows)
        latest = rows[-len(self._ring) :]
        places = (total - len(latest) + np.arange(len(latest))) % len(self._ring)
        with np.errstate(over="ignore"):
            self._ring[places] = latest
        self.total, self.at = total, at

    def since(self, seen: int, most: int) -> NDArray[np.float32]:
        """The readings after the first `seen`, at most the latest `most` of them.

        >>> shown = RecentReadings(4)
        >>> shown.add(np.arange(15.0).reshape(5, 3), 0.0)
        >>> shown.since(3, 10)[:, 0], len(shown.since(0, 10))
        (array([ 9., 12.], dtype=float32), 4)
        """
        count = min(self.total - seen, most, len(self._ring))
        places = (self.total - count + np.arange(count)) % len(self._ring)
        return np.asarray(self._ring[places])
