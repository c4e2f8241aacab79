"""What the rows of a log say, each by itself: tilt, indications, and the compass to trust."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.calibration.base import has_two_axes
from agonic.calibration.setup import Compass, Setup
from agonic.calibration.steps import find_magnitude
from agonic.headings.acceleration import ROWS, count_rows
from agonic.headings.attitude import LEVEL, Attitude, select_rows
from agonic.headings.compass_heading import Indication, Readings, compute_indication
from agonic.headings.dip_residuals import refine_tilt_sd
from agonic.headings.expected_field import Surroundings
from agonic.headings.propagation import apply_steps, list_steps, propagate
from agonic.headings.tilt_source import find_attitude
from agonic.health.finding import figure
from agonic.maths.equation.crowding import choose_evenly
from agonic.maths.rotations.angles import wrap_deg
from agonic.samples import Samples
from agonic.units import RAW

SEEN_S = (2.0, 20.0)
"""Over which magnitude and dip are averaged, before and after, that tell what disturbs a field,
whichever side is smaller: a disturbance that comes or goes ends at its row, and one that passes
through zero does not. In two seconds magnitude and dip are two numbers only."""
PASSING_S = 1.0
"""Over which a field that is off before a row and after it is off in the row too."""
SOME = 0.05
POSSIBLE, CERTAIN = 2.0, 4.0
"""From so many times the variance that is explained, to so many, what is seen is a disturbance."""
OPPOSITE_DEG = 15.0
"""A dip is the opposite of the expected one to this, and that one steep enough to tell."""


class CompassRows(NamedTuple):
    """A compass, its readings, the field (n, 3) by its calibration, what it indicates, and how far
    that field is from the expected one, 1 being the limit, (n,); `None` where it cannot be told."""

    compass: Compass
    readings: Readings
    field: Array
    indicated: Indication
    distance: Array | None = None


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
        found, field, unknown = compute_indication(readings, compass, levelled, around)
        compared = compare_with_expected(compass, found, around, setup, tilt.source)
        notes += [*unknown, *compared.notes]
        own.append(np.zeros(len(first)) if compared.distance is None else compared.distance)
        one = CompassRows(compass, readings, field, found, compared.distance)
        one = add_disturbance(one, compared, levelled, around, setup.magnitude_limit, first.time)
        if one.distance is not None and first.time is not None:
            one = one._replace(distance=bridge_disturbed(one.distance, first.time))
        compasses.append(one)
    # the row's own distance chooses, as in a vehicle, which knows no later rows: the first that was
    # read and is not disturbed; where all are, the one nearest to the expected field
    score = np.empty((len(seen), len(first)))
    for k, (distance, one) in enumerate(zip(own, compasses, strict=True)):
        score[k] = np.where(distance <= 1.0, -1.0 + 1e-6 * k, distance)
        score[k, ~np.isfinite(distance) | one.readings.missing] = np.inf
    return RowHeadings(tilt, tuple(compasses), np.argmin(score, axis=0), tuple(notes))


class Comparison(NamedTuple):
    """How far a compass's field is from the expected one, 1 being the limit, (n,); its strength
    over the expected one and its dip less that, rad. `None` where nothing is known to compare with.
    """

    distance: Array | None
    notes: tuple[str, ...] = ()
    share: Array | None = None
    steeper: Array | None = None


def compare_with_expected(
    compass: Compass, indicated: Indication, around: Surroundings, setup: Setup, tilt: str
) -> Comparison:
    """The larger of the differences of magnitude and dip, each over its limit.

    A level compass knows its horizontal intensity only, one calibrated to a magnitude alone has no
    dip to compare with, and one in raw units no magnitude. One of two axes that was calibrated
    without a place knows the intensity of its own circle.
    """
    h, z, own = indicated.horizontal, indicated.vertical, find_magnitude(compass.calibration)
    raw, why = compass.calibration.unit_out == RAW, ""
    if around.horizontal is None or around.vertical is None:
        if own is not None and tilt != LEVEL:
            return Comparison(_over(np.sqrt(h * h + z * z) / own - 1, setup.magnitude_limit))
        why = "no field to compare it with is known"
    elif tilt == LEVEL:
        if not raw:
            off = _over(h / around.horizontal - 1, setup.magnitude_limit)
            if has_two_axes(compass.calibration) and own is not None:
                off = np.minimum(off, _over(h / own - 1, setup.magnitude_limit))
            return Comparison(off)
        why = "its calibration gives raw units"
    if why:
        said = f"disturbances of {compass.sensor} were not looked for: {why}"
        return Comparison(None, (said,))
    share, steeper = around.compare(h, z, np.isfinite(h))
    distance = _over(np.degrees(steeper), setup.dip_limit_deg)
    notes = () if tilt == "log" else _tell_opposite_sign(compass, steeper, around)
    if not raw:
        distance = np.maximum(distance, _over(share - 1, setup.magnitude_limit))
        notes = (*notes, *_tell_other_magnitude(compass, share, around, setup))
    return Comparison(distance, notes, share, steeper)


def _over(difference: Array, limit: float) -> Array:
    return np.abs(difference) / max(limit, 1e-12)


def _tell_opposite_sign(compass: Compass, steeper: Array, around: Surroundings) -> tuple[str, ...]:
    """What to say of dips (n,), rad less the expected ones, that are the opposite of these."""
    expected = float(np.degrees(np.median(np.arctan2(around.vertical, around.horizontal))))  # type: ignore[arg-type]
    known = steeper[np.isfinite(steeper)]
    dip = expected + (float(np.degrees(np.median(known))) if len(known) else 0.0)
    if abs(expected) < OPPOSITE_DEG or abs(dip + expected) > OPPOSITE_DEG:
        return ()
    return (
        f"the field by {compass.sensor} seems to dip by {figure(dip)}° where it should by "
        f"{figure(expected)}°: the acceleration or the magnetometer has the opposite sign",
    )


def _tell_other_magnitude(
    compass: Compass, share: Array, around: Surroundings, setup: Setup
) -> tuple[str, ...]:
    """What to say of a magnitude that is off by the same share throughout: no row is to blame."""
    some = choose_evenly(len(share), ROWS)
    some = some[np.isfinite(share[some])]
    if not len(some):
        return ()
    share, limit = share[some], setup.magnitude_limit
    off, low, high = np.median(share) - 1, *(np.quantile(share, [0.1, 0.9]) - 1)
    if not abs(off) > limit / 2 or max(high - off, off - low) > abs(off):
        return ()
    level, below = (select_rows(v, some) for v in (around.horizontal, around.vertical))  # type: ignore[arg-type]
    there = float(np.median(np.hypot(level, below) * share))
    return (
        f"the magnitude by {compass.sensor} is {100 * abs(off):.0f} % "
        f"{'above' if off > 0 else 'below'} that of the place throughout ({there / 1000:.1f} µT "
        f"for {there / (1 + off) / 1000:.1f} µT), and more than {100 * limit:g} % is flagged "
        '"disturbed": calibrate with the place (--at LAT,LON), or indoors, where the field is '
        "another, give a declination in the setup and no place",
    )


def add_disturbance(
    one: CompassRows,
    compared: Comparison,
    attitude: Attitude,
    around: Surroundings,
    limit: float,
    time: Array | None,
) -> CompassRows:
    """The rows of a compass with the variance that disturbances seen about each row add, and with
    the larger distance from the expected field: by each row (`compared`), and by those about it;
    `limit` is that of the magnitude, a share of it."""
    indicated, distance = one.indicated, one.distance
    level, below = indicated.horizontal, indicated.vertical
    size = np.hypot(level, below)
    sound = np.isfinite(size) & (size > 0.0)
    good = np.flatnonzero(sound if distance is None else sound & (distance <= 1.0))
    if attitude.source == LEVEL or not len(good):
        return one
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
    known = _explain(one, size, good) + attitude.variance / 2
    times = seen / np.maximum(known, 1e-12)
    rows = np.flatnonzero(times > POSSIBLE)  # of most logs few
    certain = np.minimum((times[rows] - POSSIBLE) / (CERTAIN - POSSIBLE), 1.0)
    relative = certain * (seen - known)[rows]
    turned = relative * (size[rows] / np.maximum(level[rows], 1e-9)) ** 2
    systematic = indicated.systematic.copy()
    systematic[rows] += np.degrees(np.degrees(turned))
    if distance is not None:
        distance = distance.copy()
        distance[rows] = np.maximum(distance[rows], np.sqrt(relative) / max(limit, 1e-12))
    return one._replace(indicated=indicated._replace(systematic=systematic), distance=distance)


def _explain(one: CompassRows, size: Array, good: Index) -> float:
    """The relative variance of the field's magnitude by noise and calibration."""
    rows = good[choose_evenly(len(good), 2000)]
    readings, steps = one.readings.subset(rows), list_steps(one.compass.calibration)
    values = apply_steps(steps, readings.raw, readings.columns)
    systematic, noise, _ = propagate(steps, values, readings.columns, values[-1].T / size[rows])
    return float(np.mean((systematic + noise) / size[rows] ** 2))


def bridge_disturbed(distance: Array, time: Array) -> Array:
    """How far the field is from the expected one, (n,), also where it passes through that.

    Beside a magnet that is passed, magnitude and dip are the expected ones for a moment, and the
    heading may be any. So a row is beyond the limit too between rows that are, within `PASSING_S`:
    most of those on one side, and `SOME` of those on the other.
    """
    far, width = distance > 1.0, count_rows(time, PASSING_S)
    if not far.any():
        return distance
    beside = _average_beside(far.astype(np.float64), width, width)
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


def compare_compasses(
    compasses: Sequence[CompassRows], limit_deg: float
) -> tuple[Array | None, Mask | None]:
    """The largest difference between the headings of two compasses, (n,), NaN where fewer were
    read, and the rows on which two differ that are both trusted, by more than the limit and three
    of their standard deviations; `None` with a single one."""
    if len(compasses) == 1:
        return None, None
    n = len(compasses[0].indicated.magnetic_deg)
    largest, rows = np.full(n, np.nan), np.zeros(n, dtype=bool)
    for i, one in enumerate(compasses):
        for other in compasses[:i]:
            a, b = one.indicated, other.indicated
            apart = np.abs(wrap_deg(a.magnetic_deg - b.magnetic_deg))
            largest = np.fmax(largest, apart)
            sd = np.sqrt(a.random + a.systematic + b.random + b.systematic)
            off = apart > np.maximum(limit_deg, 3 * sd)
            for distance in (one.distance, other.distance):
                if distance is not None:
                    off &= distance <= 1.0
            rows |= off
    return largest, rows
