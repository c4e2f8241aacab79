"""What one compass indicates at given times: heading, its variance, and the field it rests on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index, Mask
from agonic.calibration.base import check_readings, has_two_axes, select_columns
from agonic.calibration.setup import LATENCY_SD_S, Compass
from agonic.errors import LogError
from agonic.headings.acceleration import count_rows
from agonic.headings.attitude import LEVEL, Attitude, select_rows
from agonic.headings.expected_field import Surroundings
from agonic.headings.propagation import Step, apply_steps, list_steps, list_unknowns, propagate
from agonic.maths.one_pass import interpolate
from agonic.maths.rotations import tilt as kernel
from agonic.maths.rotations.deviation import slope
from agonic.new_rows import find_fresh
from agonic.samples import Samples
from agonic.usable_rows import VECTORS

PIECE = 8192
"""Mask worked on together: their intermediate arrays stay in the cache."""
UNKNOWN_SD_DEG = 180.0 / 3**0.5
"""Standard deviation of a heading of which nothing is known."""
LONGEST_BRIDGE = 3.0
"""Readings further apart than this many periods are not joined."""
TURNING_S = 0.1
"""To either side of a row, over which its readings tell how fast they change."""


LIKELY_DIP_DEG = 65.0
"""The dip where a compass of two axes is at no known place."""


class Readings(NamedTuple):
    """Readings brought to common times: raw (n, 3), columns beside them, rows without any.

    `averaged` (n,) is what interpolation leaves of the variance of the noise; `change` (n, 3) is by
    how much the readings change in a second, where they have times; `tilt` (n, 2) is roll and pitch
    in degrees of an inclinometer that this sensor alone has.
    """

    raw: Array
    columns: Mapping[str, Array]
    missing: Mask
    averaged: Array | None = None
    change: Array | None = None
    tilt: Array | None = None

    def subset(self, rows: slice | Index) -> Readings:
        """Some of the rows."""
        columns = {name: values[rows] for name, values in self.columns.items()}
        rest: list[Any] = [None if one is None else one[rows] for one in self[3:]]
        return Readings(self.raw[rows], columns, self.missing[rows], *rest)


class Indication(NamedTuple):
    """Headings of one compass in degrees, (n,); variances in degrees²; measured intensities, nT."""

    compass_deg: Array
    magnetic_deg: Array
    random: Array
    systematic: Array
    horizontal: Array
    vertical: Array


def interpolate_readings(samples: Samples, compass: Compass, time: Array | None) -> Readings:
    """The readings that belong to the moments `time` (n,), by linear interpolation.

    A reading recorded at t shows the field of t − latency; one that is held for further rows, that
    of the first. Between readings more than `LONGEST_BRIDGE` periods apart, and outside them, there
    is none.
    """
    check_readings(compass.calibration, samples)
    columns = select_columns(compass.calibration, samples)
    fresh = find_fresh(samples.field) if samples.time is not None else np.ones(1, dtype=bool)
    if time is samples.time and compass.latency_s == 0.0 and fresh.all():
        change = None if time is None else compute_change(time, samples.field)
        return Readings(samples.field, columns, np.zeros(len(samples), dtype=bool), change=change)
    if samples.time is None or time is None:
        raise LogError(
            f"readings of {samples.name} have to be brought to other times and have none of their "
            "own; give the log a time column"
        )
    if len(samples) < 2:
        raise LogError("a single reading cannot be brought to other times; give a longer log")
    late = time + compass.latency_s  # when these moments show in the readings
    own = samples.time[fresh]
    field = interpolate(late, own, samples.field[fresh])
    moved = {
        name: (
            interpolate(late, own, values[fresh])
            if name in VECTORS
            else interpolate(time, samples.time, values)
        )
        for name, values in columns.items()
    }
    after = np.clip(np.searchsorted(own, late), 1, max(len(own) - 1, 1))
    before = after - 1
    width = own[after] - own[before]
    share = np.clip((late - own[before]) / width, 0.0, 1.0)
    period = float(np.median(np.diff(own)))
    outside = (late < own[0] - 1e-6) | (late > samples.time[-1] + 1e-6)
    missing = outside | ((width > LONGEST_BRIDGE * period) & (share * (1 - share) > 1e-9))
    averaged = share**2 + (1 - share) ** 2
    return Readings(field, moved, missing, averaged, compute_change(time, field))


def compute_change(time: Array, values: Array) -> Array | None:
    """By how much values (n, 3) change in a second, over the rows that last `TURNING_S` to either
    side of each, one at least; `None` for a single one.
    """
    if len(time) < 2:
        return None
    n, width = len(time), count_rows(time, TURNING_S)
    change = np.empty((n, 3))
    wide = slice(width, max(n - width, width))
    np.subtract(values[2 * width :], values[: -2 * width], out=change[wide])
    change[wide] /= (time[2 * width :] - time[: -2 * width])[:, None]
    ends = np.concatenate([np.arange(min(width, n)), np.arange(wide.stop, n)])
    before, after = np.maximum(ends - width, 0), np.minimum(ends + width, n - 1)
    change[ends] = (values[after] - values[before]) / (time[after] - time[before])[:, None]
    return change


def compute_indication(
    readings: Readings, compass: Compass, attitude: Attitude, around: Surroundings
) -> tuple[Indication, Array, tuple[str, ...]]:
    """The headings of one compass, the field (n, 3) that they rest on, and what their standard
    error leaves out; all is computed piece by piece."""
    steps = list_steps(compass.calibration)
    n = len(readings.raw)
    result, fields = Indication(*(np.empty(n) for _ in Indication._fields)), np.empty((n, 3))
    notes = list(list_unknowns(steps, compass.sensor))
    if compass.deviation is not None and compass.deviation.covariance is None:
        notes.append(f"the deviation card of {compass.sensor} has no covariance: not in the sd")
    if has_two_axes(compass.calibration) and around.vertical is None:
        notes.append(
            f"the dip of the place is not known and taken to be {LIKELY_DIP_DEG:g}°: give the "
            "place (--at LAT,LON) for what a tilt does"
        )
    elif attitude.source == LEVEL and around.vertical is None and not readings.raw[:, 2].any():
        notes.append("the vertical intensity is not known, so errors of tilt are not in the sd")
    for start in range(0, n, PIECE):
        rows = slice(start, start + PIECE)
        found, fields[rows] = _piece(readings, rows, steps, compass, attitude, around)
        for whole, part in zip(result, found, strict=True):
            whole[rows] = part
    result.compass_deg[readings.missing] = result.magnetic_deg[readings.missing] = np.nan
    return result, fields, tuple(notes)


def _piece(
    readings: Readings,
    rows: slice,
    steps: tuple[Step, ...],
    compass: Compass,
    attitude: Attitude,
    around: Surroundings,
) -> tuple[Indication, Array]:
    readings = readings.subset(rows)
    values = apply_steps(steps, readings.raw, readings.columns)
    tilt, tangent = attitude.select_tilt(rows), around.find_dip_tangent(rows)
    field = np.ascontiguousarray(values[-1].T)
    if has_two_axes(compass.calibration):  # what it has instead of a vertical
        likely = np.tan(np.radians(LIKELY_DIP_DEG))
        field[2] = np.hypot(field[0], field[1]) * (likely if tangent is None else tangent)
    elif attitude.source == LEVEL and around.vertical is not None:
        field[2] = select_rows(around.vertical, rows)
    with np.errstate(divide="ignore", invalid="ignore"):  # where nothing of the field is level
        turned = kernel.heading_with_derivatives(field.T, tilt, attitude.order)
        systematic, random, gradient = propagate(steps, values, readings.columns, turned.by_field)
        systematic += _by_tilt(turned, attitude, tangent, rows)
        if readings.change is not None and (late_sd := find_latency_sd(compass)):
            # what the readings change in the error of the delay beside an attitude that is on time
            turn = np.einsum("in,ni->n", gradient, readings.change)
            systematic += (late_sd * turn) ** 2
    if readings.averaged is not None:
        random *= readings.averaged
    systematic, random = np.degrees(np.degrees(systematic)), np.degrees(np.degrees(random))
    magnetic, card = turned.heading_deg, compass.deviation
    if card is not None:
        heel = kernel.roll_pitch_deg(tilt) if card.heel is not None else (0.0, 0.0)
        terms = np.append(card.coefficients, np.zeros(4) if card.heel is None else card.heel)
        gain = 1 + slope(terms, magnetic, *heel)  # d(magnetic)/d(compass)
        own = 0.0 if card.covariance is None else card.sd_at(magnetic, *heel) ** 2
        magnetic = kernel.wrap_turn_deg(magnetic + card.at(magnetic, *heel))
        systematic, random = gain**2 * systematic + own, gain**2 * random
    intensities = turned.horizontal, turned.vertical
    return Indication(turned.heading_deg, magnetic, random, systematic, *intensities), values[-1]


def find_latency_sd(compass: Compass) -> float:
    """The standard error of a compass's delay, s: as it is known, or as delays usually scatter."""
    return LATENCY_SD_S if compass.latency_sd_s is None else compass.latency_sd_s


def _by_tilt(
    turned: kernel.HeadingDerivatives, attitude: Attitude, tangent: Array | None, rows: slice
) -> Array:
    """Variance that errors of tilt make, rad², (n,).

    A tilt that is far off shows the field at a dip that is not its own, with derivatives to match;
    where the `tangent` of the dip of the place is known, errors turn the heading by it at least.
    """
    roll, pitch = (select_rows(sd, rows) ** 2 for sd in (attitude.roll_sd, attitude.pitch_sd))
    linear = roll * turned.by_roll**2 + pitch * turned.by_pitch**2
    if tangent is None:
        return linear
    return np.maximum(linear, select_rows(attitude.variance, rows) * tangent**2)


def pick_used(used: Index, values: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Row by row, the value of the compass that is used."""
    return values[0] if len(values) == 1 else np.take_along_axis(np.stack(values), used[None], 0)[0]
