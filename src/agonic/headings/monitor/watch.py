"""Two whole compasses watched row by row: rows into blocks, into faults; those of a log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.base import has_two_axes
from agonic.calibration.monitoring import BLOCK_S, MonitorParams, derive_monitor_params
from agonic.calibration.setup import Setup
from agonic.headings.attitude import LEVEL
from agonic.headings.expected_field import Surroundings
from agonic.headings.monitor.baseline import Block, State, start
from agonic.headings.monitor.detect import Seen, advance
from agonic.headings.monitor.result import UNITS, CompassFault
from agonic.headings.rows import RowHeadings
from agonic.units import RAW


class CompassReadings(NamedTuple):
    """Readings of both compasses, row by row.

    Parameters
    ----------
    time : (n,) s. field : (n, 2, 3) nT, and down : (n, 2, 3) of length one, in body axes.
    magnitude, vertical : to expect, nT, (n,) or a number each.
    """

    time: Array
    field: Array
    down: Array
    magnitude: Array | float
    vertical: Array | float


class Watch(NamedTuple):
    """What a monitor carries from rows to rows: the `state`, the sums of the unfinished block, the
    rows in it, its end, s, and all `faults` so far, those that last included."""

    state: State
    sums: Block | None = None
    held: int = 0
    end_s: float = -np.inf
    faults: tuple[CompassFault, ...] = ()


def watch_compasses(
    rows: CompassReadings,
    params: MonitorParams,
    before: Watch | None = None,
    *,
    names: Sequence[str],
) -> Watch:
    """Go on watching two compasses; rows in any pieces give the same as all at once.

    Parameters: `rows`; `params` of `derive_monitor_params`; `before`, what the last call returned,
    `None` at first; the `names` of the compasses. Returns a `Watch` with all `faults` so far.

    Source: A. S. Willsky, H. L. Jones (1976), A generalized likelihood ratio approach to the
    detection and estimation of jumps in linear systems, IEEE Transactions on Automatic Control
    21(1), 108–112, for the tests; the thresholds are those of `find_threshold`.

    >>> rng = np.random.default_rng(0)
    >>> time = np.arange(0.0, 900.0, 0.5)
    >>> field = np.array([20_000.0, 0, 40_000]) + rng.normal(scale=50.0, size=(1800, 2, 3))
    >>> field[1500:, 1] += [800.0, 0, 800]
    >>> down = np.broadcast_to([0.0, 0, 1], (1800, 2, 3))
    >>> rows = CompassReadings(time, field, down, 44_721.4, 40_000.0)
    >>> params = MonitorParams(field=44_721.4, horizontal=20_000.0)
    >>> found = watch_compasses(rows, params, names="ab").faults
    >>> [(fault.unit, fault.sensor, round(fault.began_s)) for fault in found]
    [('magnetometer', 'b', 750)]
    """
    now = Watch(start(params)) if before is None else before
    expected, below = (
        np.broadcast_to(value, rows.time.shape)[:, None]
        for value in (rows.magnitude, rows.vertical)
    )
    size = np.linalg.norm(rows.field, axis=-1)
    strength = size - expected
    vertical = (rows.field * rows.down).sum(axis=-1) - below / expected * size
    field, down = rows.field.mean(axis=1), rows.down.mean(axis=1)
    level = field - (field * down).sum(axis=-1, keepdims=True) * down
    whole = Block(rows.field, rows.down, strength, vertical, level)
    at = 0
    while at < len(rows.time):
        if rows.time[at] >= now.end_s:
            now = _close(now, params, names)._replace(end_s=float(rows.time[at]) + BLOCK_S)
        to = int(np.searchsorted(rows.time, now.end_s))
        part = Block(*(values[at:to] for values in whole))
        sums = Block(*(values.sum(axis=0) for values in part))
        if now.sums is not None:
            sums = Block(*(a + b for a, b in zip(now.sums, sums, strict=True)))
        now = now._replace(sums=sums._replace(level=part.level[-1]), held=now.held + to - at)
        at = to
    return now


def _close(now: Watch, params: MonitorParams, names: Sequence[str]) -> Watch:
    """The watch with its block finished, and the faults that it tells."""
    if now.sums is None:
        return now
    block = Block(*(values / now.held for values in now.sums))._replace(level=now.sums.level)
    state, seen = advance(params, now.state, block)
    faults = list(now.faults)
    for group, unit in enumerate(UNITS):
        lasting = next((f for f in faults if f.unit == unit and f.ended_s is None), None)
        if lasting is not None:
            faults.remove(lasting)
        if state.since[group]:
            faults.append(_tell(state, seen, group, now.end_s, names, lasting))
        elif lasting is not None:
            faults.append(replace(lasting, ended_s=now.end_s))
    return Watch(state, end_s=now.end_s, faults=tuple(faults))


def _tell(
    state: State,
    seen: Seen,
    group: int,
    end_s: float,
    names: Sequence[str],
    before: CompassFault | None,
) -> CompassFault:
    """The fault of a group as it is known at the end of a block."""
    which = int(state.named[group]) - 1
    change = seen.change[group] * (-1.0 if which == 1 else 1.0)
    sd = float(seen.sd[group])
    if UNITS[group] == "inclinometer":  # down moves right by a roll, back by a pitch
        change, sd = np.degrees([change[1], -change[0], 0.0]), float(np.degrees(sd))
    named_s = end_s if which >= 0 else None
    if before is not None:
        named_s = named_s if before.named_s is None else before.named_s
        began_s, began_sd_s, seen_s = before.began_s, before.began_sd_s, before.seen_s
    else:
        began_s, seen_s = end_s - BLOCK_S * float(seen.began[group]), end_s
        began_sd_s = BLOCK_S * float(seen.began_sd[group])
    return CompassFault(
        unit=UNITS[group],
        sensor=names[which] if which >= 0 else None,
        use=names[1 - which] if which >= 0 else None,
        began_s=began_s,
        began_sd_s=began_sd_s,
        seen_s=seen_s,
        named_s=named_s,
        ended_s=None,
        change=np.asarray(change),
        sd=sd,
    )


def watch_pair(
    time: Array | None, by_row: RowHeadings, setup: Setup, around: Surroundings
) -> tuple[CompassFault, ...]:
    """The faults of two compasses in a log; none where there are not two that can be compared.

    Where no field is expected, the medians of both are.
    """
    tilt, compasses = by_row.tilt, by_row.compasses
    known = [one.compass.calibration for one in compasses]
    flat = tilt.source == LEVEL or any(map(has_two_axes, known))
    if time is None or len(compasses) != 2 or flat or any(one.unit_out == RAW for one in known):
        return ()
    n = len(time)
    field = np.stack([one.field for one in compasses], axis=1)
    downs = (tilt.with_own(one.readings.tilt).down for one in compasses)
    down = np.stack([np.broadcast_to(own, (n, 3)) for own in downs], axis=1)
    there = np.isfinite(field).all(axis=(1, 2)) & np.isfinite(down).all(axis=(1, 2))
    for one in compasses:
        there &= ~one.readings.missing
    if not there.any():
        return ()
    if around.horizontal is None or around.vertical is None:
        size = np.full(n, np.median(np.linalg.norm(field[there], axis=-1)))
        below = np.full(n, np.median((field[there] * down[there]).sum(axis=-1)))
        level = np.sqrt(np.maximum(size**2 - below**2, 0.0))
    else:
        level, below = (np.broadcast_to(v, n) for v in (around.horizontal, around.vertical))
        size = np.hypot(level, below)
    params = derive_monitor_params(setup, float(np.median(size)), float(np.median(level)))
    rows = CompassReadings(*(v[there] for v in (time, field, down, size, below)))
    return watch_compasses(rows, params, names=[one.compass.sensor for one in compasses]).faults
