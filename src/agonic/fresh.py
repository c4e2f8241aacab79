"""Sensors that read more slowly than the log is written: which rows are new, and what lies between.

A reading that is held for ten rows is late by up to nine of them; integrated or compared with what
turns, it is wrong.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Mask
from agonic.samples import Samples

HELD = 1 / 3
"""Of the rows: where more repeat the row before, the sensor is slower than the log."""

FEWEST = 10
"""Changes that show how long a sensor holds its readings: a thing at rest has fewer."""


def find_fresh(values: Array) -> Mask:
    """The rows (n, 3) with a reading of their own; all of them where few repeat the one before.

    Of a sensor at rest that reads the same for longer than twice the usual number of rows, one in
    so many is taken to be its own.

    >>> find_fresh(np.repeat(np.arange(30.0).reshape(10, 3), 3, axis=0))[:6].tolist()
    [True, False, False, True, False, False]
    """
    fresh = np.ones(len(values), dtype=bool)
    fresh[1:] = (values[1:] != values[:-1]).any(axis=1)
    if np.mean(~fresh) <= HELD or fresh.sum() < FEWEST:
        return np.ones_like(fresh)
    starts = np.flatnonzero(fresh)
    usual = int(np.median(np.diff(starts)))
    age = np.arange(len(values)) - starts[np.cumsum(fresh) - 1]
    return np.asarray(fresh | ((age >= 2 * usual) & (age % usual == 0)))


def without_held(samples: Samples) -> Samples:
    """The samples with acceleration and rates interpolated over rows that only repeat one."""
    time = samples.time
    if time is None:
        return samples
    found = {}
    for name in ("acceleration", "rotation_rate"):
        values: Array | None = getattr(samples, name)
        if values is None:
            continue
        fresh = find_fresh(values)
        if not fresh.all():
            axes = [np.interp(time, time[fresh], axis[fresh]) for axis in values.T]
            found[name] = np.stack(axes, axis=1)
    return samples.with_columns(**found) if found else samples
