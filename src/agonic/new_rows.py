"""Sensors that read more slowly than the log is written: which rows are new, and what lies between.

A reading that is held for ten rows is late by up to nine of them; integrated or compared with what
turns, it is wrong.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Mask
from agonic.maths.one_pass import interpolate, median
from agonic.maths.rotations.angles import wrap_deg
from agonic.samples import Samples

HELD = 1 / 3
"""Of the rows: where more repeat the row before, the sensor is slower than the log."""

FEWEST = 10
"""Changes that show how long a sensor holds its readings: a thing at rest has fewer."""
FARTHEST_DEG = 90.0
"""Between two angles that a slow attitude gives; of more nobody knows which way it went."""


def find_changed(values: Array) -> Mask:
    """The rows of values (n, k) that differ from the row before, the first among them."""
    same = np.ones(max(len(values) - 1, 0), dtype=bool)
    for column in values.T:  # column by column: a test of each short row takes three times as long
        same &= column[1:] == column[:-1]
    return np.concatenate([np.ones(len(values) - len(same), dtype=bool), ~same])


def find_fresh(values: Array) -> Mask:
    """The rows (n, 3) with a reading of their own; all of them where few repeat the one before.

    Of a sensor at rest that reads the same for longer than twice the usual number of rows, one in
    so many is taken to be its own.
    """
    fresh = find_changed(values)
    if np.mean(~fresh) <= HELD or fresh.sum() < FEWEST:
        return np.ones_like(fresh)
    starts = np.flatnonzero(fresh)
    usual = int(median(np.diff(starts)))
    age = np.arange(len(values)) - starts[np.cumsum(fresh) - 1]
    return np.asarray(fresh | ((age >= 2 * usual) & (age % usual == 0)))


def interpolate_repeated(samples: Samples) -> Samples:
    """Samples with acceleration, rates and angles interpolated over rows that only repeat one."""
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
            found[name] = interpolate(time, time[fresh], values[fresh])
    for names in (("roll_deg", "pitch_deg"), ("heading_deg",)):
        angles = {name: angle for name in names if (angle := getattr(samples, name)) is not None}
        if not angles:
            continue
        fresh = find_fresh(np.stack(list(angles.values()), axis=1))
        if not fresh.all() and _turns_on(samples.field, fresh):
            found |= {name: _fill_angle(time, fresh, angle) for name, angle in angles.items()}
    return samples.with_columns(**found) if found else samples


def _turns_on(field: Array, fresh: Mask) -> bool:
    """Whether readings (n, 3) go on changing while angles are held, as beside a slow attitude, or
    are held too.

    Of a sensor that is held still in one pose after another, they change from pose to pose, but for
    their noise.
    """
    starts = np.flatnonzero(fresh)
    first, last = starts[:-1], starts[1:] - 1
    long = last > first
    within = np.linalg.norm(field[last] - field[first], axis=1)[long]
    across = np.linalg.norm(field[last + 1] - field[last], axis=1)[long]
    if not len(within):
        return False
    usual = median(within)
    return usual == 0.0 or usual > median(across) / 2


def _fill_angle(time: Array, fresh: Mask, angle_deg: Array) -> Array:
    """Angles (n,) the short way round between rows of their own; held where that is too far to know
    the way."""
    own = np.unwrap(angle_deg[fresh], period=360.0)
    between = np.interp(time, time[fresh], own)
    between = between % 360.0 if angle_deg.min() >= 0 else wrap_deg(between)
    far = np.append(np.abs(np.diff(own)) > FARTHEST_DEG, False)
    held = far[np.cumsum(fresh) - 1] | fresh
    return np.where(held, angle_deg, between)
