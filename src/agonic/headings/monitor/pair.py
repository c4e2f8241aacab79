"""The monitor on the rows of a log with two compasses."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.calibration.base import has_two_axes
from agonic.calibration.monitoring import derive_monitor_params
from agonic.calibration.setup import Setup
from agonic.headings.attitude import LEVEL
from agonic.headings.expected_field import Surroundings
from agonic.headings.monitor.result import CompassFault
from agonic.headings.monitor.watch import CompassReadings, watch_compasses
from agonic.headings.propagation import apply_steps, list_steps
from agonic.headings.rows import RowHeadings
from agonic.maths.rotations.tilt import compute_down
from agonic.units import RAW


def watch_pair(
    time: Array | None, by_row: RowHeadings, setup: Setup, around: Surroundings
) -> tuple[CompassFault, ...]:
    """The faults of two compasses in a log; none where there are not two that can be compared.

    Where no field is expected, the medians of both are.
    """
    tilt, compasses = by_row.tilt, by_row.compasses
    flat = tilt.source == LEVEL or any(has_two_axes(one.compass.calibration) for one in compasses)
    raw = any(one.compass.calibration.unit_out == RAW for one in compasses)
    if time is None or len(compasses) != 2 or flat or raw:
        return ()
    fields, downs = [], []
    for one in compasses:
        readings, own = one.readings, tilt.with_own(one.readings.tilt)
        steps = list_steps(one.compass.calibration)
        fields.append(apply_steps(steps, readings.raw, readings.columns)[-1])
        downs.append(np.broadcast_to(compute_down(own.tilt, own.order), (len(time), 3)))
    field, down = np.stack(fields, axis=1), np.stack(downs, axis=1)
    there = np.isfinite(field).all(axis=(1, 2)) & np.isfinite(down).all(axis=(1, 2))
    for one in compasses:
        there &= ~one.readings.missing
    if not there.any():
        return ()
    if around.horizontal is None or around.vertical is None:
        size = np.full(len(time), np.median(np.linalg.norm(field[there], axis=-1)))
        below = np.full(len(time), np.median((field[there] * down[there]).sum(axis=-1)))
        level = np.sqrt(np.maximum(size**2 - below**2, 0.0))
    else:
        level, below = (np.broadcast_to(v, len(time)) for v in (around.horizontal, around.vertical))
        size = np.hypot(level, below)
    params = derive_monitor_params(setup, float(np.median(size)), float(np.median(level)))
    rows = CompassReadings(time[there], field[there], down[there], size[there], below[there])
    return watch_compasses(rows, params, names=[one.compass.sensor for one in compasses]).faults
