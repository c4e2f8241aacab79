"""Readings at which an axis sticks: a dead zone, or codes of the converter that never come."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.health.evidence import MOST_ROWS
from agonic.health.finding import Finding, figure
from agonic.maths.equation.crowding import choose_evenly
from agonic.maths.one_pass import median

FEWEST_TIMES, FEWEST_LEVELS = 5, 40
PILED, APART = 5.0, 10.0
"""A level comes so many times as often as others, and is so many of their steps apart."""
SAME = 1e-6
"""Of an axis' range: readings closer than that are one level, which arithmetic has rounded."""
TURNED = 0.2
"""Of their range: by so much the other axes move while one sticks."""


class DeadZone(NamedTuple):
    """The reading `level` that an `axis` gives for all between `low` and `high`."""

    axis: int
    level: float
    low: float
    high: float


def find_dead_zones(field: Array) -> list[DeadZone]:
    """Zones of each axis (n, 3) in which it gives one reading while the others move.

    There one level comes far more often than those about it, and those next to it are missing: an
    axis that rests, or turns level in coarse steps, comes often by a level and by the next as well.

    >>> rng = np.random.default_rng(0)
    >>> field = rng.uniform(-50, 50, size=(2000, 3))
    >>> find_dead_zones(field)
    []
    >>> field[np.abs(field[:, 1]) < 2, 1] = 0.0
    >>> [(zone.axis, zone.level) for zone in find_dead_zones(field)]
    [(1, 0.0)]
    """
    some = field[choose_evenly(len(field), MOST_ROWS)]
    return [zone for axis in range(3) for zone in _find_on_axis(some, axis)]


def find_rows_in(field: Array, zones: list[DeadZone]) -> Mask:
    """Rows (n,) in which an axis sticks."""
    inside = np.zeros(len(field), dtype=bool)
    for zone in zones:
        inside |= (field[:, zone.axis] > zone.low) & (field[:, zone.axis] < zone.high)
    return inside


def check_dead_zones(field: Array, zones: list[DeadZone], unit: str) -> Finding | None:
    """The finding that an axis sticks at some readings."""
    if not zones:
        return None
    where = " and ".join(
        f"{'xyz'[zone.axis]} at {figure(zone.level)} (between {figure(zone.low)} and "
        f"{figure(zone.high)} {unit})"
        for zone in zones[:3]
    )
    count = int(find_rows_in(field, zones).sum())
    return Finding(
        "dead zone",
        "check",
        f"an axis sticks at one reading while the others move: {where}, in {count} readings, which "
        "were left out; a heading from such readings is wrong, whatever the calibration",
        "check whether a driver or a filter cuts small readings off, or replace the sensor",
    )


def _find_on_axis(field: Array, axis: int) -> list[DeadZone]:
    values = field[:, axis]
    same = SAME * np.ptp(values)
    if not 0 < same < np.inf:
        return []
    levels, counts = np.unique(np.round(values / same), return_counts=True)
    if len(levels) <= FEWEST_LEVELS:
        return []
    often = counts[1:-1] >= max(FEWEST_TIMES, PILED * median(counts))
    others = np.delete(field, axis, axis=1)
    zones = []
    for k in 1 + np.flatnonzero(often):
        near = np.diff(levels[max(k - FEWEST_LEVELS // 2, 0) : k + FEWEST_LEVELS // 2])
        if levels[k + 1] - levels[k - 1] < APART * np.sort(near)[:-2].mean():
            continue
        there = others[np.round(values / same) == levels[k]]
        moved = np.ptp(np.percentile(there, (5, 95), axis=0), axis=0)
        if (moved > TURNED * np.ptp(others, axis=0)).any():
            at = (levels[k], levels[k - 1] + 0.5, levels[k + 1] - 0.5)
            zones.append(DeadZone(axis, *(float(level * same) for level in at)))
    return zones
