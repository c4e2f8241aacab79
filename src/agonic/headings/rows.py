"""What the rows of a log say, each by itself: tilt, indications, and the compass to trust."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.calibration.base import Calibration
from agonic.calibration.setup import Compass, Setup
from agonic.headings.acceleration import ROWS, count_rows
from agonic.headings.attitude import LEVEL, Attitude
from agonic.headings.compass_heading import Indication, Readings, compute_indication
from agonic.headings.dip_residuals import refine_tilt_sd
from agonic.headings.disagreement import Comparison, choose_compass, compare_with_expected
from agonic.headings.expected_field import Surroundings
from agonic.headings.propagation import Step, apply_steps, list_steps, propagate
from agonic.headings.tilt_source import find_attitude
from agonic.maths.equation.crowding import choose_evenly
from agonic.samples import Samples

SEEN_S = (2.0, 20.0)
"""Over which magnitude and dip are averaged, before and after, that tell what disturbs a field,
whichever side is smaller: a disturbance that comes or goes ends at its row, and one that passes
through zero does not. In two seconds magnitude and dip are two numbers only."""
PASSING_S = 1.0
"""Over which a field that is off before a row and after it is off in the row too."""
SOME = 0.05
POSSIBLE, CERTAIN = 2.0, 4.0
"""From so many times the variance that is explained, to so many, what is seen is a disturbance."""
SAMPLE = 2000
"""Rows, spread evenly over the log, by which noise and calibration count."""


def add_disturbance(
    indicated: Indication,
    compared: Comparison,
    readings: Readings,
    calibration: Calibration,
    attitude: Attitude,
    around: Surroundings,
    limit: float,
    time: Array | None,
) -> tuple[Indication, Array | None]:
    """The indication with the variance that disturbances seen about each row add to it, and how
    far the field is from the expected one, 1 being the limit: by each row, and by those about it.

    Parameters: `compared` each row by itself; `limit` of the magnitude, a share of it; `time` (n,)
    in seconds, or `None`.
    """
    level, below, distance = indicated.horizontal, indicated.vertical, compared.distance
    size = np.hypot(level, below)
    sound = np.isfinite(size) & (size > 0.0)
    good = np.flatnonzero(sound if distance is None else sound & (distance <= 1.0))
    if attitude.source == LEVEL or not len(good):
        return indicated, distance
    good = good[choose_evenly(len(good), ROWS)]
    share, steeper = compared.share, compared.steeper
    if share is None or steeper is None:
        share, steeper = around.compare(level, below, good)
    off = (share / np.median(share[good]) - 1.0) ** 2 + steeper**2
    seen = np.where(sound, off, 0.0) / 2
    if time is not None:
        short, long = (count_rows(time, duration) for duration in SEEN_S)
        near, far = (_average_beside(seen, width, short // 2) for width in (short, long))
        both = np.isfinite(far).all(axis=0)  # at the ends of the log one side may go too far
        seen = np.maximum(near.min(axis=0), np.where(both, far.min(axis=0), 0.0))
    known = _explain(readings, list_steps(calibration), size, good) + attitude.variance / 2
    times = seen / np.maximum(known, 1e-12)
    certain = np.clip((times - POSSIBLE) / (CERTAIN - POSSIBLE), 0.0, 1.0)
    relative = np.where(sound, certain * np.maximum(seen - known, 0.0), 0.0)
    turned = relative * (size / np.maximum(level, 1e-9)) ** 2
    doubt = np.where(sound, np.degrees(np.degrees(turned)), 0.0)
    if distance is not None:
        distance = np.maximum(distance, np.sqrt(relative) / max(limit, 1e-12))
    return indicated._replace(systematic=indicated.systematic + doubt), distance


def bridge_disturbed(distance: Array | None, time: Array | None) -> Array | None:
    """How far the field is from the expected one, (n,), also where it passes through that.

    Beside a magnet that is passed, magnitude and dip are the expected ones for a moment, and the
    heading may be any. So a row is beyond the limit too between rows that are, within `PASSING_S`:
    most of those on one side, and `SOME` of those on the other.

    >>> passed = np.repeat([0.2, 3.0, 0.5, 3.0, 0.2], [30, 30, 5, 30, 30])
    >>> np.flatnonzero(bridge_disturbed(passed, np.arange(125) / 20.0) > 1.0)[[0, -1]].tolist()
    [30, 94]
    """
    if distance is None or time is None:
        return distance
    width = count_rows(time, PASSING_S)
    off = (distance > 1.0).astype(np.float64)
    beside = _average_beside(off, width, width)
    beside = np.where(np.isfinite(beside), beside, 0.0)
    more, less = beside.max(axis=0), beside.min(axis=0)
    between = (more > 0.5) & (less > SOME)
    return np.where(between, np.maximum(distance, 2 * more), distance)


def _average_beside(values: Array, width: int, least: int) -> Array:
    """The means over so many rows up to each, and from it on, (2, n).

    A side that has fewer rows than `least`, at the ends of the log, is infinite: it does not tell.
    """
    n = len(values)
    width, least = min(width, n), min(least, (n + 1) // 2)
    total = np.concatenate([[0.0], np.cumsum(values)])
    sides = np.full((2, n), np.inf)
    inner = (total[width:] - total[:-width]) / width
    sides[0, width - 1 :] = sides[1, : n - width + 1] = inner
    few = np.arange(max(least, 1), width)  # rows of a side at the ends
    sides[0, few - 1] = total[few] / few
    sides[1, n - few] = (total[n] - total[n - few]) / few
    return sides


def _explain(readings: Readings, steps: tuple[Step, ...], size: Array, good: Index) -> float:
    """The relative variance of the field's magnitude by noise and calibration."""
    rows = good[choose_evenly(len(good), SAMPLE)]
    readings = readings.subset(rows)
    values = apply_steps(steps, readings.raw, readings.columns)
    systematic, noise, _ = propagate(steps, values, readings.columns, values[-1].T / size[rows])
    return float(np.mean((systematic + noise) / size[rows] ** 2))


class CompassRows(NamedTuple):
    """A compass, its readings, what it indicates, and how far that is from what is expected."""

    compass: Compass
    readings: Readings
    indicated: Indication
    distance: Array | None


class RowHeadings(NamedTuple):
    """The tilt, what each compass says, and the one that each row (n,) is taken from."""

    tilt: Attitude
    compasses: tuple[CompassRows, ...]
    used: Index
    notes: tuple[str, ...]


def find_row_headings(
    first: Samples,
    seen: Sequence[tuple[Compass, Readings]],
    setup: Setup,
    around: Surroundings,
) -> RowHeadings:
    """Each row by itself; the samples of the first compass tell the tilt."""
    tilt = find_attitude(first, setup, seen[0][0].calibration)
    tilt = refine_tilt_sd(tilt, list(seen), around, setup, first.time)
    notes: list[str] = []
    compasses, own = [], []
    for compass, readings in seen:
        levelled = tilt.with_own(readings.tilt)
        found, unknown = compute_indication(readings, compass, levelled, around)
        verdict = compare_with_expected(compass, found, around, setup, tilt.source)
        notes += [*unknown, *verdict.notes]
        own.append(verdict.distance)
        found, distance = add_disturbance(
            found,
            verdict,
            readings,
            compass.calibration,
            levelled,
            around,
            setup.magnitude_limit,
            first.time,
        )
        distance = bridge_disturbed(distance, first.time)
        compasses.append(CompassRows(compass, readings, found, distance))
    # the row's own distance chooses, as in a vehicle, which knows no later rows
    used = choose_compass(own, [one.readings.missing for one in compasses], len(first))
    return RowHeadings(tilt, tuple(compasses), np.asarray(used), tuple(notes))
