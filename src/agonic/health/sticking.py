"""Axes that stick: at one reading for a time, at the end of their range, or in a dead zone."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.health.evidence import MIN_READINGS, MOST_ROWS
from agonic.maths.equation.crowding import choose_evenly
from agonic.maths.one_pass import median


class Sticking(NamedTuple):
    """Rows (n,) in which each axis stands still while the others move, in which one is at the end
    of its range, and in which one is in one of the `zones` that read alike."""

    stuck: list[Mask]
    clipped: Mask
    zones: list[DeadZone]
    in_zones: Mask


def find_sticking(field: Array) -> Sticking:
    """Where the axes of readings (n, 3) stick."""
    zones = find_dead_zones(field)
    stuck = [find_stuck_rows(field, axis) for axis in range(3)]
    return Sticking(stuck, find_clipped_rows(field), zones, _find_rows_in(field, zones))


def find_usable_rows(field: Array) -> Mask:
    """Rows (n,) whose three axes all read what the field was. An axis that hardly ever moves leaves
    all rows in, for the fit to be refused on them."""
    found = find_sticking(field)
    stuck = [rows for rows in found.stuck if not is_throughout(rows)]
    return np.asarray(~np.any([found.clipped, found.in_zones, *stuck], axis=0))


def find_stuck_rows(field: Array, axis: int) -> Mask:
    """Rows (n,) of long stretches in which an axis stands still while the others move. An axis in
    coarse steps, that mostly repeats anyway, is not taken for stuck, nor one that comes back to the
    end of its range."""
    return find_stuck_values(field[:, axis], lambda: np.delete(field, axis, axis=1))


def find_stuck_values(values: Array, find_others: Callable[[], Array]) -> Mask:
    """The same of values (n,) beside others (n, k), asked for only where values stand still."""
    n = len(values)
    stuck = np.zeros(n, dtype=bool)
    still = np.concatenate([[False], values[1:] == values[:-1], [False]])
    edges = np.flatnonzero(still[1:] != still[:-1])
    starts, stops = edges[::2], edges[1::2] + 1
    long = stops - starts >= min(max(50, 0.02 * n), max(n, MIN_READINGS))
    if not long.any():
        return stuck
    others = find_others()
    reach = np.ptp(others, axis=0)
    for start, stop in zip(starts[long], stops[long], strict=True):
        moved = np.ptp(others[start:stop], axis=0)
        returns = np.count_nonzero(values == values[start]) > stop - start
        at_end = values[start] in (values.min(), values.max())
        stuck[start:stop] = ((moved > MIN_MOTION * reach) & (moved > 0)).any() and not (
            at_end and returns
        )
    usual = still[1:-1][~stuck[1:]]
    return stuck & (len(usual) == 0 or usual.mean() <= 0.5)


def is_throughout(stuck: Mask) -> bool:
    """Whether an axis stands still in all rows but too few to be judged."""
    return int(np.count_nonzero(~stuck)) < min(MIN_READINGS, len(stuck))


def find_clipped_rows(field: Array) -> Mask:
    """Rows (n,) in which an axis sits at the end of its range. A clipped axis piles up at one value
    while the other axes still move. At an honest extreme the pile is low (a sensor passes it
    quickly) and the others are near their middle, within √(2 R q) for a sphere of radius R in steps
    of q. Where one axis is clipped, others that end at the same value are."""
    ends: list[tuple[float, Mask]] = []
    limits: set[float] = set()
    for axis in range(3):
        for values in (field[:, axis], -field[:, axis]):
            limit = float(values.max())
            at_end = values == limit
            ends.append((limit, at_end))
            if np.count_nonzero(at_end) >= 5 and _piles_up(
                values, np.delete(field, axis, axis=1), at_end
            ):
                limits.add(limit)
    clipped = [at_end for limit, at_end in ends if limit in limits]
    return np.any(clipped, axis=0) if clipped else np.zeros(len(field), dtype=bool)


def _piles_up(values: Array, others: Array, at_end: Mask) -> bool:
    """Whether the readings at the end of an axis are many and spread over the other axes."""
    levels, counts = np.unique(values, return_counts=True)
    if len(levels) < 8 or counts[-1] < 5 * counts[-4:-1].mean():
        return False
    radius = (levels[-1] - levels[0]) / 2
    step = (levels[-1] - levels[-4]) / 3
    spread = np.diff(np.percentile(others[at_end], (5, 95), axis=0), axis=0).max()
    return bool(spread > 3 * np.sqrt(2 * radius * step))


MIN_COUNT, MIN_LEVELS = 5, 40
PILE_OVER_USUAL, GAP_OVER_USUAL = 5.0, 10.0
"""A level comes so many times as often as others, and is so many of their steps apart."""
SAME_LEVEL = 1e-6
"""Of an axis' range: readings closer than that are one level, which arithmetic has rounded."""
MIN_MOTION = 0.2
"""Of their range: by so much the other axes move while one sticks."""


class DeadZone(NamedTuple):
    """The reading `level` that an `axis` gives for all between `low` and `high`."""

    axis: int
    level: float
    low: float
    high: float


def find_dead_zones(field: Array) -> list[DeadZone]:
    """Zones of each axis (n, 3) in which it gives one reading while the others move. There one
    level comes far more often than those about it, and those next to it are missing: an axis that
    rests, or turns level in coarse steps, comes often by a level and by the next as well.
    """
    some = field[choose_evenly(len(field), MOST_ROWS)]
    return [zone for axis in range(3) for zone in _find_on_axis(some, axis)]


def _find_on_axis(field: Array, axis: int) -> list[DeadZone]:
    values = field[:, axis]
    same = SAME_LEVEL * np.ptp(values)
    if not 0 < same < np.inf:
        return []
    levels, counts = np.unique(np.round(values / same), return_counts=True)
    if len(levels) <= MIN_LEVELS:
        return []
    often = counts[1:-1] >= max(MIN_COUNT, PILE_OVER_USUAL * median(counts))
    others = np.delete(field, axis, axis=1)
    zones = []
    for k in 1 + np.flatnonzero(often):
        near = np.diff(levels[max(k - MIN_LEVELS // 2, 0) : k + MIN_LEVELS // 2])
        if levels[k + 1] - levels[k - 1] < GAP_OVER_USUAL * np.sort(near)[:-2].mean():
            continue
        there = others[np.round(values / same) == levels[k]]
        moved = np.ptp(np.percentile(there, (5, 95), axis=0), axis=0)
        if (moved > MIN_MOTION * np.ptp(others, axis=0)).any():
            at = (levels[k], levels[k - 1] + 0.5, levels[k + 1] - 0.5)
            zones.append(DeadZone(axis, *(float(level * same) for level in at)))
    return zones


def _find_rows_in(field: Array, zones: list[DeadZone]) -> Mask:
    """Rows (n,) in which an axis sticks."""
    inside = np.zeros(len(field), dtype=bool)
    for zone in zones:
        inside |= (field[:, zone.axis] > zone.low) & (field[:, zone.axis] < zone.high)
    return inside
