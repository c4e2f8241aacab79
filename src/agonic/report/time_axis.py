"""Time along a strip, in a unit that fits how long it is."""

from __future__ import annotations

from agonic.arrays import Array
from agonic.report.strips import Axis

_TIME_UNITS = (
    (172_800.0, 86_400.0, "days"),
    (7200.0, 3600.0, "h"),
    (300.0, 60.0, "min"),
    (0.0, 1.0, "s"),
)


def along_time(
    time: Array, start: float, stop: float, since: str = "the first reading"
) -> tuple[Axis, Array]:
    """An axis of the time since `start` in a unit that fits, and times as they lie along it.

    >>> import numpy as np
    >>> along_time(np.array([60.0, 660.0]), 60.0, 660.0)
    (Axis(label='time since the first reading, min', low=0.0, high=10.0), array([ 0., 10.]))
    """
    seconds, name = next((s, n) for least, s, n in _TIME_UNITS if stop - start >= least)
    label = f"time since {since}, {name}"
    return Axis(label, 0.0, (stop - start) / seconds), (time - start) / seconds
