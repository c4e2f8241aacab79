"""`Track`: the way a sensor went, with accelerometer and gyro, in bounded room.

Which way is down is felt from what lasts for seconds, and a gyro is summed up over time, so single
readings of many directions do not do: a fit beside them needs rows one after the other. A row is
the mean of all readings in an interval of time. Where there are too many rows the interval doubles;
where it is too long for that, the stretch of rows in which the sensor turned least is given up.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.samples import Samples

Slots = NDArray[np.int64]

ROW_COLUMNS = 11
"""Of a row: how many readings, their time, field (3), acceleration (3) and rotation rate (3)."""

MAX_ROWS = 4096
"""Rows at most."""

FINEST_S = 0.02
"""The first interval: short beside all that a vehicle does."""

MAX_WIDTH_SLOTS = 8
"""Times the first the last one may be: a vehicle that turns 1 rad/s has turned by 9° in it."""

STRETCH_SLOTS = 8 * 64
"""Finest intervals, ten seconds, that are given up together."""


class Track(NamedTuple):
    """Rows `sums` (k, 11) of readings added up, each in its slot `slots` (k,) of `FINEST_S` after
    `start`, s; `width` slots are one row, and `last_s` is the time of the last reading."""

    start: float
    width: int
    slots: Slots
    sums: Array
    last_s: float

    def make_samples(self, name: str, unit: str, device_id: int | None = None) -> Samples:
        """The means of the rows, with the rates where a gyro told them."""
        means = self.sums[:, 1:] / self.sums[:, :1]
        rate = means[:, 7:]
        turned = np.isfinite(rate).all() and rate.any()  # a device without a gyro may send zeros
        return Samples(
            time=self.start + means[:, 0],
            field=means[:, 1:4],
            acceleration=means[:, 4:7],
            rotation_rate=rate if turned else None,
            unit=unit,
            name=name,
            device_id=device_id,
        )

    def coarsen(self) -> Track:
        """The track in the longest intervals."""
        return _sum_up(self._replace(width=MAX_WIDTH_SLOTS))

    @property
    def duration_s(self) -> float:
        """From the first row to the last."""
        times = self.sums[[0, -1], 1] / self.sums[[0, -1], 0]
        return float(times[1] - times[0])

    @property
    def down(self) -> Array:
        """Roughly which way is down in each row, (k, 3)."""
        force = self.sums[:, 5:8]
        return np.asarray(-force / np.maximum(np.linalg.norm(force, axis=1), 1e-9)[:, None])


def extend_track(track: Track | None, rows: Array, motion: Array) -> Track | None:
    """The track with further readings, the same however they are cut in chunks."""
    with np.errstate(invalid="ignore"):
        felt = np.isfinite(motion[:, :3]).all(axis=1) & motion[:, :3].any(axis=1)
    earlier = np.concatenate([[-np.inf if track is None else track.last_s], rows[:, 0]])
    later = rows[:, 0] > np.maximum.accumulate(earlier)[:-1]
    rows, motion = rows[felt & later], motion[felt & later]
    if not len(rows):
        return track
    if track is None:
        start = float(rows[0, 0])
        track = Track(start, 1, np.empty(0, np.int64), np.empty((0, ROW_COLUMNS)), -np.inf)
    since = rows[:, 0] - track.start
    slots = np.floor(since / FINEST_S + 1e-6).astype(np.int64)
    sums = np.column_stack([np.ones(len(rows)), since, rows[:, 1:], motion])
    cuts = np.flatnonzero(np.diff(slots // STRETCH_SLOTS)) + 1
    for own, more in zip(np.split(slots, cuts), np.split(sums, cuts), strict=True):
        own, more = np.concatenate([track.slots, own]), np.concatenate([track.sums, more])
        track = _trim(_sum_up(track._replace(slots=own, sums=more)))
    return track._replace(last_s=float(rows[-1, 0]))


def _sum_up(track: Track) -> Track:
    """The rows of each interval added up."""
    slots = track.slots // track.width * track.width
    first = np.flatnonzero(np.diff(slots, prepend=-1))
    return track._replace(slots=slots[first], sums=np.add.reduceat(track.sums, first))


def _trim(track: Track) -> Track:
    """At most `MAX_ROWS`: of longer intervals, or without the stretch that turned least."""
    while len(track.slots) > MAX_ROWS and track.width < MAX_WIDTH_SLOTS:
        track = _sum_up(track._replace(width=2 * track.width))
    while len(track.slots) > MAX_ROWS:
        stretch = track.slots // STRETCH_SLOTS
        stay = stretch != _find_stillest(track, stretch)
        track = track._replace(slots=track.slots[stay], sums=track.sums[stay])
    return track


def _find_stillest(track: Track, stretch: Slots) -> int:
    """The stretch, of all but the last, in which the field in the sensor moved least."""
    field = track.sums[:, 2:5] / track.sums[:, :1]
    steps = np.append(np.linalg.norm(np.diff(field, axis=0), axis=1), 0.0)
    numbers, place = np.unique(stretch, return_inverse=True)
    moved = np.bincount(place, steps)[:-1]
    return int(numbers[np.argmin(moved)])
