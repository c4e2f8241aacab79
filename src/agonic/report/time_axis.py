"""Time along a strip, in a unit that fits how long it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.arrays import Array, Index
from agonic.report.axes import Axis

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
    >>> axis, at = along_time(np.array([60.0, 660.0]), 60.0, 660.0)
    >>> axis.label, axis.low, axis.high, at.tolist()
    ('time since the first reading, min', 0.0, 10.0, [0.0, 10.0])
    """
    seconds, name = next((s, n) for least, s, n in _TIME_UNITS if stop - start >= least)
    label = f"time since {since}, {name}"
    return Axis(label, 0.0, (stop - start) / seconds), (time - start) / seconds


def along_rows(time: Array | None, rows: Index) -> tuple[Axis, Array]:
    """Time since the first reading, or the number of the reading where no times were logged.

    `time` (n,) is that of all readings, `rows` (m,) those that are shown. Findings tell moments by
    the clock of the log, so the label says where it stood at the first reading.

    >>> import numpy as np
    >>> along_rows(np.array([11.5, 12.5]), np.arange(2))[0].label
    'time since the first reading (t = 11.5 s), s'
    >>> along_rows(None, np.arange(3))
    (Axis(label='reading', low=0.0, high=2.0, logarithmic=False), array([0., 1., 2.]))
    """
    if time is None or len(time) < 2:
        return Axis("reading", 0.0, float(max(rows.max(), 1))), rows.astype(np.float64)
    start, stop = float(time[0]), float(time[-1])
    begun = "" if start == 0.0 else f" (t = {start:.1f} s)"
    axis, along = along_time(time[rows], start, stop, since=f"the first reading{begun}")
    return replace(axis, clock=(start, stop)), along
