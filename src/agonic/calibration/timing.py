"""How what is recorded of a disturber goes with what it does: late, or through a filter.

A column z that is recorded `late_s` late tells of now that much later. With a time constant τ the
sensor is a first-order filter of what disturbs, x, between rows a step dt apart:

    z ← z + (1 − k) (x − z),   k = exp(−dt/τ),   undone by   x = z + (z − z before) k / (1 − k)

A negative τ is the reverse: the field follows the column, as that of a torquer follows its command:

    x ← x + (1 − k) (z − x),   k = exp(dt/τ).

Both need the row before and nothing later, so a controller can do them too.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.calibration.sources import parse_source
from agonic.errors import AgonicError


class Timing(NamedTuple):
    """How late a column is recorded, s, and the time constant of its filter, s; negative where the
    field follows the column instead."""

    late_s: float = 0.0
    time_constant_s: float = 0.0


def find_timing(sources: Iterable[str]) -> dict[str, Timing]:
    """The timing of each column of sources that has one."""
    found: dict[str, Timing] = {}
    for source in map(parse_source, sources):
        timing = Timing(source.late_s, source.time_constant_s)
        for name in source.columns:
            if found.setdefault(name, timing) != timing:
                raise AgonicError(f"{name} is taken with two delays or time constants; give one")
    return {name: timing for name, timing in found.items() if timing != Timing()}


def restore(columns: Mapping[str, Array], timing: Mapping[str, Timing]) -> dict[str, Array]:
    """The columns as they act on the field at their rows, by `time`. At the end of what is recorded
    late, where nothing later is, the last value holds."""
    moved = {name: timing[name] for name in timing if name in columns}
    if moved and "time" not in columns:
        raise AgonicError(
            f"{', '.join(moved)} is recorded late or filtered, which needs times; there are none"
        )
    return {**columns, **{name: _restore(columns, name, moved[name]) for name in moved}}


def _restore(columns: Mapping[str, Array], name: str, timing: Timing) -> Array:
    time, values = columns["time"], np.asarray(columns[name], dtype=np.float64)
    if timing.time_constant_s < 0:
        values = follow(time, values, -timing.time_constant_s)
    elif timing.time_constant_s > 0:
        values = undo_filter(time, values, timing.time_constant_s)
    return np.interp(time + timing.late_s, time, values) if timing.late_s else values


def follow(time: Array, values: Array, time_constant_s: float) -> Array:
    """Values (n,) through a first-order filter, begun at the first."""
    gained = -np.expm1(-np.diff(time) / time_constant_s)
    rows = zip(values[1:].tolist(), gained.tolist(), strict=True)
    first = float(values[0]) if len(values) else 0.0
    filtered = accumulate(rows, lambda x, row: x + row[1] * (row[0] - x), initial=first)
    return np.fromiter(filtered, dtype=np.float64)[: len(values)]


def undo_filter(time: Array, values: Array, time_constant_s: float) -> Array:
    """What went into a first-order filter that gave values (n,): the reverse of `follow`."""
    with np.errstate(over="ignore"):  # a gap far longer than the time constant adds nothing
        ahead = np.diff(values) / np.expm1(np.diff(time) / time_constant_s)
    return np.concatenate([values[:1], values[1:] + ahead])
