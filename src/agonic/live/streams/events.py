"""What a source tells: readings and their times, and how it is getting on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array


class Chunk(NamedTuple):
    """Readings of one sensor: `time` (n,) s, `field` (n, 3) in `unit`, in the axes `frame`.
    `motion` (n, 6) is what an inertial unit told with them: acceleration, m/s², and rotation rate,
    rad/s, NaN where it did not; `own` (n,) the device's own clock, s, NaN where it told none."""

    sensor: str
    time: Array
    field: Array
    unit: str
    frame: str = "m"
    device_id: int | None = None
    motion: Array | None = None
    own: Array | None = None


class Notice(NamedTuple):
    """How a source is getting on, in words; `connected` whether readings can come."""

    connected: bool
    text: str
    ended: bool = False


class Words(NamedTuple):
    """Lines of another kind than readings, of one sender, without the mark that told them."""

    origin: str
    lines: list[str]


Event = Chunk | Notice | Words


class Clock:
    """The device's own time where it tells, moved to begin at the first arrival; else the arrival,
    readings that came together a millisecond apart. Times of a sensor always increase."""

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
                if not last < moment < now + 60.0:  # the device was started anew
                    moment = max(now, last + 1e-4)
                    self._offset[sensor] = moment - own
            self._last[sensor] = moment
            result.append(moment)
        return np.array(result)
