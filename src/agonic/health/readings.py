"""What can be said of readings before any fit: frozen, sticking, clipped, stale, too few."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.health.decoding import find_decoding
from agonic.health.evidence import FEWEST, MOST_ROWS
from agonic.health.finding import Finding, figure
from agonic.health.scale import check_gravity, find_quantisation
from agonic.maths.equation.crowding import choose_evenly
from agonic.maths.one_pass import find_length, median
from agonic.new_rows import find_changed
from agonic.samples import Samples

_STEADIEST = 3e-7
"""Relative scatter of the magnitude below which it was made, not measured; float32 has 6e-8."""
_UNREAD = ("times left out", "acc left out", "gyro left out")
"""How the notes of a reader begin on what it found and could not read."""


def inspect(samples: Samples) -> tuple[Finding, ...]:
    """Everything that the readings alone give away."""
    field = samples.field
    stuck = [find_stuck_rows(field, axis) for axis in range(len(samples.axes))]
    found = [
        *check_rejected(samples.rejected, len(samples) + sum(samples.rejected.values())),
        *find_decoding(samples),
        check_gravity(samples),
        *_list_few(samples),
        *_list_frozen(stuck),
        *_list_clipped(find_clipped_rows(field) & ~np.any(stuck, axis=0)),
        *_list_dead_zones(field, samples.unit),
        *_list_facts(samples),
        *_list_normalised(field),
    ]
    return tuple(finding for finding in found if finding is not None)


def _list_few(samples: Samples) -> Iterator[Finding]:
    if len(samples) < FEWEST:
        yield Finding(
            "too few readings",
            "refuse",
            f"only {len(samples)} readings: with nine unknowns none are left to check the result",
            "record at least a few hundred while turning the sensor about all axes",
        )


def _list_facts(samples: Samples) -> Iterator[Finding]:
    """What the log says of itself: readings that repeat, gaps, corrections, what was not read."""
    fresh = np.count_nonzero(find_changed(samples.field)) - 1
    share = 1.0 - fresh / (len(samples) - 1) if len(samples) > 1 else 0.0
    if share >= 0.05:
        yield Finding(
            "repeated readings",
            "note",
            f"{100 * share:.0f} % of the readings repeat the one before: the log runs faster than "
            "the sensor",
        )
    if samples.time is not None and len(samples) >= FEWEST:
        steps = np.diff(samples.time)
        count = int((steps > max(20 * median(steps), 1.0)).sum())
        if count:
            many = f"{count} gap{'s' if count > 1 else ''} in time"
            yield Finding("gaps", "note", f"{many}, the longest {steps.max():.1f} s")
    if samples.corrected:
        yield Finding(
            "corrected readings",
            "check",
            "the autopilot or the device had corrected these readings in a way that the log does "
            "not state, so the result comes on top of that correction and is not exported to an "
            "autopilot",
            "record uncorrected readings, or calibrate from the vehicle's own log, or join the "
            "result and the parameters in force then (agonic export --on OLD.param)",
        )
    unread = [note for note in samples.notes if note.startswith(_UNREAD)]
    if unread:
        yield Finding(
            "not read",
            "note",
            f"not all of the log could be read: {'; '.join(unread)}",
            "the result is from the rest; name columns and units in the header, or with --columns",
        )


def find_usable_rows(field: Array) -> Mask:
    """Rows (n,) whose three axes all read what the field was: neither clipped, stuck nor in a dead
    zone. An axis that hardly ever moves leaves all rows in, for the fit to be refused on them."""
    spoilt = find_clipped_rows(field) | find_rows_in(field, find_dead_zones(field))
    for axis in range(3):
        stuck = find_stuck_rows(field, axis)
        if not _throughout(stuck):
            spoilt |= stuck
    return ~spoilt


def describe(samples: Samples) -> tuple[Finding, ...]:
    """What `inspect` finds and what is merely worth knowing: steps, a correction in the log."""
    size = find_quantisation(samples.field)
    more = []
    if size is not None:
        more.append(
            Finding("coarse steps", "note", f"readings come in steps of {size:.4g} {samples.unit}")
        )
    if samples.logged is not None:
        what = f"the log holds readings corrected by {samples.logged.source}; raw ones recovered"
        more.append(Finding("already corrected", "note", what))
    return (*inspect(samples), *more)


def check_rejected(rejected: Mapping[str, int], total: int) -> list[Finding]:
    """Rows of so many that hold no number or no time of their own, by the reason.

    >>> check_rejected({"time does not increase": 3}, 1000)[0].what
    '3 of 1000 rows were left out (time does not increase)'
    """
    return [
        Finding(
            "NaN" if "NaN" in why or "scalar" in why else "torn end" if "ends" in why else "clock",
            "check" if count > 0.01 * total and "scalar" not in why else "note",
            f"{count} of {total} rows were left out ({why})",
            "look at the logger" if count > 0.01 * total and "scalar" not in why else "",
        )
        for why, count in rejected.items()
        if count
    ]


def _list_normalised(field: Array) -> Iterator[Finding]:
    """Readings that a driver has divided by their own length: no magnitude is left to fit. No
    sensor is so steady: even in one place its noise is some parts in 10⁵."""
    size = find_length(field)
    middle = float(size.mean()) if len(field) >= FEWEST else 0.0
    turned = np.ptp(field, axis=0).max(initial=0.0) > 0.1 * middle
    if 0 < middle < np.inf and turned and float(size.std()) <= _STEADIEST * middle:
        yield Finding(
            "normalised",
            "refuse",
            "all readings have exactly the same length: they were normalised, and the information "
            "on bias and soft iron is lost",
            "have the driver record the readings as measured",
        )


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
    long = stops - starts >= min(max(50, 0.02 * n), max(n, FEWEST))
    if not long.any():
        return stuck
    others = find_others()
    reach = np.ptp(others, axis=0)
    for start, stop in zip(starts[long], stops[long], strict=True):
        moved = np.ptp(others[start:stop], axis=0)
        returns = np.count_nonzero(values == values[start]) > stop - start
        at_end = values[start] in (values.min(), values.max())
        stuck[start:stop] = ((moved > 0.2 * reach) & (moved > 0)).any() and not (at_end and returns)
    usual = still[1:-1][~stuck[1:]]
    return stuck & (len(usual) == 0 or usual.mean() <= 0.5)


def _throughout(stuck: Mask) -> bool:
    """Whether an axis stands still in all rows but too few to be judged."""
    return int(np.count_nonzero(~stuck)) < min(FEWEST, len(stuck))


def _list_frozen(stuck: Sequence[Mask]) -> Iterator[Finding]:
    """Axes that stand still, throughout or for a time, while the others move."""
    for axis, rows in zip("xyz", stuck, strict=False):
        if not rows.any():
            continue
        what = (
            f"stands still while the others move, in {int(rows.sum())} readings "
            f"from row {int(np.argmax(rows))} on, which were left out"
        )
        move, dead = "check the sensor and its wiring", _throughout(rows)
        if dead:
            what = f"{'never' if rows.all() else 'hardly ever'} changes while the others do"
            if len(stuck) == 3:
                move += "; with two axes it can only be used as a level compass"
        yield Finding("frozen axis", "refuse" if dead else "check", f"axis {axis} {what}", move)


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


def _list_clipped(clipped: Mask) -> Iterator[Finding]:
    if clipped.any():
        yield Finding(
            "clipping",
            "check",
            f"{int(clipped.sum())} readings ({100 * clipped.mean():.1f} %) sit at the end of the "
            "sensor's range and were left out",
            "choose a larger range, or move the sensor away from magnets and iron",
        )


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
    """Zones of each axis (n, 3) in which it gives one reading while the others move. There one
    level comes far more often than those about it, and those next to it are missing: an axis that
    rests, or turns level in coarse steps, comes often by a level and by the next as well.

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


def _list_dead_zones(field: Array, unit: str) -> Iterator[Finding]:
    zones = find_dead_zones(field)
    if zones:
        where = " and ".join(
            f"{'xyz'[zone.axis]} at {figure(zone.level)} (between {figure(zone.low)} and "
            f"{figure(zone.high)} {unit})"
            for zone in zones[:3]
        )
        yield Finding(
            "dead zone",
            "check",
            f"an axis sticks at one reading while the others move: {where}, in "
            f"{int(find_rows_in(field, zones).sum())} readings, which were left out; a heading "
            "from such readings is wrong, whatever the calibration",
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
