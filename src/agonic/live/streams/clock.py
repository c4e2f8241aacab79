"""`Clock`: times of readings that arrive live."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agonic.arrays import Array

LEAP_S = 60.0
"""A device's clock that runs ahead by more was set anew."""


class Clock:
    """The device's own time where it tells, moved to begin at the first arrival; else the arrival,
    readings that came together a millisecond apart. Times of a sensor always increase.

    >>> clock = Clock()
    >>> clock.times([5.0, 5.1], 100.0, "mag"), clock.times([0.0], 101.0, "mag")
    (array([100. , 100.1]), array([101.]))
    """

    def __init__(self) -> None:
        self._offset: dict[str, float] = {}
        self._last: dict[str, float] = {}

    def times(self, told: Sequence[float | None], now: float, sensor: str) -> Array:
        """When readings of a sensor that arrived `now` were made, `told` by the device or not."""
        result = []
        for k, own in enumerate(told):
            last = self._last.get(sensor, -np.inf)
            if own is None or not np.isfinite(own):
                moment = max(now - 1e-3 * (len(told) - 1 - k), last + 1e-4)
            else:
                moment = own + self._offset.setdefault(sensor, now - own)
                if not last < moment < now + LEAP_S:  # the device was started anew
                    moment = max(now, last + 1e-4)
                    self._offset[sensor] = moment - own
            self._last[sensor] = moment
            result.append(moment)
        return np.array(result)
