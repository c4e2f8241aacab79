"""What can be said of readings before any fit: frozen, clipped, stale, too few."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from agonic.arrays import Array, Mask
from agonic.health.dead_zone import check_dead_zones, find_dead_zones, find_rows_in
from agonic.health.decoding import find_decoding
from agonic.health.evidence import FEWEST
from agonic.health.finding import Finding
from agonic.health.resolution import find_quantisation
from agonic.health.scale import check_gravity
from agonic.maths.one_pass import find_length, median
from agonic.samples import Samples

_STEADIEST = 3e-7
"""Relative scatter of the magnitude below which it was made, not measured; float32 has 6e-8."""
_UNREAD = ("times left out", "acc left out", "gyro left out")
"""How the notes of a reader begin on what it found and could not read."""


def inspect(samples: Samples) -> tuple[Finding, ...]:
    """Everything that the readings alone give away.

    >>> flat = Samples(field=np.random.default_rng(0).normal(size=(50, 3)) * [1, 0, 1])
    >>> [finding.name for finding in inspect(flat)]
    ['frozen axis']
    """
    stuck = [find_stuck_rows(samples.field, axis) for axis in range(len(samples.axes))]
    found = [
        *check_rejected(samples.rejected, len(samples) + sum(samples.rejected.values())),
        *find_decoding(samples),
        check_gravity(samples),
        _few(samples),
        *(_check_frozen(rows, axis) for axis, rows in enumerate(stuck)),
        _check_clipped(find_clipped_rows(samples.field) & ~np.any(stuck, axis=0)),
        check_dead_zones(samples.field, find_dead_zones(samples.field), samples.unit),
        _stale(samples.field),
        _gaps(samples),
        _check_corrected(samples),
        _unread(samples),
        _check_normalised(samples.field),
    ]
    return tuple(finding for finding in found if finding is not None)


def find_usable_rows(field: Array) -> Mask:
    """Rows (n,) whose three axes all read what the field was: neither clipped, stuck nor in a
    dead zone.

    An axis that hardly ever moves leaves all rows in, for the fit to be refused on them.
    """
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


def _check_normalised(field: Array) -> Finding | None:
    """Readings that a driver has divided by their own length: no magnitude is left to fit.

    No sensor is so steady: even in one place its noise is some parts in 10⁵.
    """
    if len(field) < FEWEST:
        return None
    size = find_length(field)
    middle = float(size.mean())
    turned = max(float(np.ptp(axis)) for axis in field.T) > 0.1 * middle
    if not (0 < middle < np.inf) or not turned or float(size.std()) > _STEADIEST * middle:
        return None
    return Finding(
        "normalised",
        "refuse",
        "all readings have exactly the same length: they were normalised, and the information on "
        "bias and soft iron is lost",
        "have the driver record the readings as measured",
    )


def _unread(samples: Samples) -> Finding | None:
    """A clock, an accelerometer or a gyroscope that is in the log and could not be read."""
    told = [note for note in samples.notes if note.startswith(_UNREAD)]
    if not told:
        return None
    return Finding(
        "not read",
        "note",
        f"not all of the log could be read: {'; '.join(told)}",
        "the result is from the rest; name columns and units in the header, or with --columns",
    )


def _few(samples: Samples) -> Finding | None:
    if len(samples) >= FEWEST:
        return None
    return Finding(
        "too few readings",
        "refuse",
        f"only {len(samples)} readings: with nine unknowns none are left to check the result",
        "record at least a few hundred while turning the sensor about all axes",
    )


def find_stuck_rows(field: Array, axis: int) -> Mask:
    """Rows (n,) of long stretches in which an axis stands still while the others move.

    An axis in coarse steps, that mostly repeats anyway, is not taken for stuck, nor one that comes
    back to the end of its range.
    """
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


def _check_frozen(stuck: Mask, axis: int) -> Finding | None:
    """An axis that stands still, throughout or for a time, while the others move."""
    if not stuck.any():
        return None
    what = (
        f"stands still while the others move, in {int(stuck.sum())} readings "
        f"from row {int(np.argmax(stuck))} on, which were left out"
    )
    move, dead = "check the sensor and its wiring", _throughout(stuck)
    if dead:
        what = f"{'never' if stuck.all() else 'hardly ever'} changes while the others do"
        move += "; with two axes it can only be used as a level compass"
    said = f"axis {'xyz'[axis]} {what}"
    return Finding("frozen axis", "refuse" if dead else "check", said, move)


def find_clipped_rows(field: Array) -> Mask:
    """Rows (n,) in which an axis sits at the end of its range.

    A clipped axis piles up at one value while the other axes still move. At an honest extreme the
    pile is low (a sensor passes it quickly) and the others are near their middle, within
    √(2 R q) for a sphere of radius R in steps of q. Where one axis is clipped, others that end at
    the same value are.
    """
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


def _check_clipped(clipped: Mask) -> Finding | None:
    if not clipped.any():
        return None
    share = 100 * clipped.mean()
    return Finding(
        "clipping",
        "check",
        f"{int(clipped.sum())} readings ({share:.1f} %) sit at the end of the sensor's range and "
        "were left out",
        "choose a larger range, or move the sensor away from magnets and iron",
    )


def _stale(field: Array) -> Finding | None:
    x, y, z = (column[1:] == column[:-1] for column in field.T)
    share = float((x & y & z).mean()) if len(field) > 1 else 0.0
    if share < 0.05:
        return None
    return Finding(
        "repeated readings",
        "note",
        f"{100 * share:.0f} % of the readings repeat the one before: the log runs faster than the "
        "sensor",
    )


def _gaps(samples: Samples) -> Finding | None:
    if samples.time is None or len(samples) < FEWEST:
        return None
    steps = np.diff(samples.time)
    gaps = steps > max(20 * median(steps), 1.0)
    if not gaps.any():
        return None
    return Finding(
        "gaps",
        "note",
        f"{int(gaps.sum())} gap{'s' if gaps.sum() > 1 else ''} in time, "
        f"the longest {steps.max():.1f} s",
    )


def _check_corrected(samples: Samples) -> Finding | None:
    if not samples.corrected:
        return None
    return Finding(
        "corrected readings",
        "check",
        "the autopilot or the device had corrected these readings in a way that the log does not "
        "state, so the result comes on top of that correction and is not exported to an autopilot",
        "record uncorrected readings, or calibrate from the vehicle's own log, or join the result "
        "and the parameters in force then (agonic export --on OLD.param)",
    )
