"""What is wrong with accelerometer and gyro, seen from what they read, before any fit.

A unit, an axis that is dead or stands still, a stream that has stopped, axes and units that do not
go with those of the other sensors: each is a `Fault`, with what mends it where something does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from agonic.arrays import Array, Mask
from agonic.health.finding import Fact, Finding, Told, figure, find_facts, find_first, word_fact
from agonic.health.scale import STUCK_SHARE
from agonic.health.sticking import find_stuck_rows, find_stuck_values
from agonic.health.turning import (
    GRAVITY_TURNING,
    MIN_ROWS,
    SMOOTHED_S,
    TURNING,
    find_telling,
)
from agonic.maths.one_pass import find_length, median
from agonic.maths.rotations.low_pass import low_pass
from agonic.new_rows import find_changed
from agonic.samples import Samples
from agonic.units import STANDARD_GRAVITY_M_S2

PINNED = 0.02
"""Of the rows at the largest rate: fewer are chance."""
SCALE = 2.0
"""An acceleration that is so many times gravity, or so small a part of it, has another unit."""
_NEAR = 0.2
"""Of gravity: so near to it an acceleration in another unit is."""
_NOTHING = 0.05
"""Of gravity: less is felt by what floats in space, or by nothing at all."""
_ACCELERATION_UNITS = (
    (STANDARD_GRAVITY_M_S2, "g"),
    (STANDARD_GRAVITY_M_S2 / 1000, "thousandths of g"),
)
_ANGLES = ("roll_deg", "pitch_deg", "heading_deg")
_SENSORS = {"acceleration": "accelerometer", "rotation_rate": "gyro"}


class Fault(NamedTuple):
    """What is wrong with a column of samples; `repaired` (n, 3) where the fault can be undone."""

    column: str
    finding: Finding
    repaired: Array | None = None


_FOUND: WeakKeyDictionary[Samples, tuple[Fault, ...]] = WeakKeyDictionary()


def repair(samples: Samples) -> tuple[Samples, tuple[Finding, ...]]:
    """The samples without what cannot be repaired of accelerometer and gyro, and the findings.
    Samples without a fault are returned themselves: what was found of them is kept with them."""
    faults = find_faults(samples)
    if not faults:
        return samples, ()
    repaired = samples.with_columns(**{fault.column: fault.repaired for fault in faults})
    return repaired, tuple(fault.finding for fault in faults)


def leave_out_faulty(samples: Samples) -> tuple[Samples, tuple[Finding, ...]]:
    """The same for a fit that needs neither: what was left out is to be looked at."""
    clipped = check_clipping(samples)  # which matters to a delay beside it only
    samples, found = repair(samples)
    noted: tuple[Finding, ...] = () if clipped is None else (replace(clipped, severity="note"),)
    told = tuple(
        replace(one, severity="check", what=f"{one.what}; it was left out")
        if one.severity == "refuse"
        else one
        for one in found
    )
    return samples, (*told, *(noted if samples.rotation_rate is not None else ()))


def find_faults(samples: Samples) -> tuple[Fault, ...]:
    """The faults of accelerometer and gyro, one of each at most. Several fits to one log ask for
    them: as long as the samples live they are found once."""
    if samples not in _FOUND:
        _FOUND[samples] = _find_faults(samples)
    return _FOUND[samples]


def _find_faults(samples: Samples) -> tuple[Fault, ...]:
    found: dict[str, Fault] = {}
    for columns, fact in FACTS:
        for column in columns:
            told = None if getattr(samples, column) is None else fact.measure(samples, column)
            finding = word_fact(fact, told, sensor=_SENSORS[column])
            if finding is None:
                continue
            repaired = told.get("repaired") if isinstance(told, Mapping) else None
            found.setdefault(column, Fault(column, finding, repaired))
            samples = samples.with_columns(**{column: repaired})
    return tuple(found.values())


def _measure_nothing(samples: Samples, column: str) -> Told:
    """A device without an accelerometer or a gyro may send zeros for it."""
    return None if getattr(samples, column).any() else {}


def _measure_scale(samples: Samples, _: str) -> Told:
    """An acceleration in another unit: what it is at rest is not gravity. Its direction is all that
    a fit takes, so one of unknown unit is scaled to gravity."""
    force = samples.acceleration
    assert force is not None, "a column of the table"
    telling = find_telling(samples)
    assert telling.acceleration is not None
    # vibration adds to it, unless it is smoothed out, and turning takes from it where it is
    sizes = [median(find_length(telling.acceleration))]
    if telling.time is not None and len(telling) >= MIN_ROWS:
        smooth = low_pass(telling.acceleration, median(np.diff(telling.time)), SMOOTHED_S[0])
        sizes.append(median(find_length(smooth)))
    size = min(sizes, key=lambda one: abs(np.log(max(one, 1e-300) / STANDARD_GRAVITY_M_S2)))
    share = size / STANDARD_GRAVITY_M_S2
    factor, unit = 1 / share, ""
    for known, name in _ACCELERATION_UNITS:
        if abs(share * known - 1) < _NEAR:
            factor, unit = known, name
    if 1 / SCALE < share < SCALE or (share < _NOTHING and not unit):
        return None
    looks = f"it is in {unit}" if unit else "its unit is another one"
    return {"size": size, "looks": looks, "factor": factor, "repaired": factor * force}


def _measure_still_axis(samples: Samples, column: str) -> Told:
    """The first axis that stands still while the others move."""
    values: Array = getattr(samples, column)
    if not _is_noisy(values):
        return None
    stuck = np.stack([find_stuck_rows(values, axis) for axis in range(3)])
    axis = int(np.argmax(stuck.mean(axis=1) >= STUCK_SHARE))
    if (share := float(stuck[axis].mean())) < STUCK_SHARE:
        return None
    return {
        "axis": "xyz"[axis],
        "level": float(values[np.argmax(stuck[axis]), axis]),
        "unit": "rad/s" if column == "rotation_rate" else "m/s²",
        "rows": "all rows" if share == 1.0 else f"{100 * share:.0f} % of the rows",
    }


def _is_noisy(values: Array) -> bool:
    """Whether readings (n, 3) flicker, so that an axis that does not is no axis at rest. Third
    differences of a smooth motion, as a computer makes it, go on alike; those of noise go to and
    fro."""
    if len(values) < MIN_ROWS:
        return False
    jerk = np.diff(values, n=3, axis=0)
    to_and_fro = (jerk[1:] * jerk[:-1]).sum(axis=0) < 0
    return bool((to_and_fro & (np.median(np.abs(jerk), axis=0) > 0)).any())


def _measure_stopped(samples: Samples, column: str) -> Told:
    """A stream that stops while the field moves."""
    values: Array = getattr(samples, column)
    if not _is_noisy(values):
        return None
    return _tell_since(samples, find_stopped_rows(values, [samples.field]))


def _tell_since(samples: Samples, stopped: Mask) -> Told:
    """How many rows those are in which a stream had stopped, and since when; None where few."""
    if samples.time is None or stopped.mean() < STUCK_SHARE:
        return None
    since = figure(float(samples.time[np.argmax(stopped)]), 4)
    return {"share": 100 * float(stopped.mean()), "since": since}


NOTHING = Fact(
    "inertial unit",
    _measure_nothing,
    "note",
    "the {sensor} reads nothing but zeros; it was left out",
)
SCALE_OFF = Fact(
    "inertial unit",
    _measure_scale,
    "check",
    "the acceleration is {size} in size where gravity is 9.8 m/s²: {looks}",
    "name its unit; it was taken times {factor:3}",
)
STILL_AXIS = Fact(
    "inertial unit",
    _measure_still_axis,
    "refuse",
    "axis {axis} of the {sensor} reads {level} {unit} in {rows} while its other axes move: it is "
    "dead or at the end of its range",
    "check the {sensor}, its range and its wiring, and record again",
)
STREAM_STOPPED = Fact(
    "inertial unit",
    _measure_stopped,
    "refuse",
    "the {sensor} repeats one reading in {share:.0f} % of the rows while the magnetometer moves, "
    "from t = {since} s on: it stopped",
    "record again with the {sensor} running throughout, or use the part of the log before",
)
FACTS = (
    (("acceleration", "rotation_rate"), NOTHING),
    (("acceleration",), SCALE_OFF),
    (("acceleration", "rotation_rate"), STILL_AXIS),
    (("acceleration", "rotation_rate"), STREAM_STOPPED),
    (("rotation_rate",), TURNING),
    (("acceleration",), GRAVITY_TURNING),
)
"""What may be wrong with columns of samples, in the order in which it is looked for."""
STOPPED = Fact(
    "stopped",
    _tell_since,
    "check",
    "the magnetometer repeats one reading in {share:.0f} % of the rows while other sensors move, "
    "from t = {since} s on: it had stopped, and they were left out",
    "check the sensor and its wiring, and whether it can fail in use",
)


def find_stopped_readings(samples: Samples) -> tuple[Mask, Finding] | None:
    """The rows (n,) in which the magnetometer had stopped, for something else turned; and the
    finding. `None` where there are few, or nothing tells."""
    columns = [getattr(samples, name) for name in ("rotation_rate", "acceleration", *_ANGLES)]
    others = [column for column in columns if column is not None]
    if samples.time is None or len(samples.time) < MIN_ROWS or not others:
        return None
    stopped = find_stopped_rows(samples.field, others)
    finding = find_first([STOPPED], samples, stopped)
    return None if finding is None else (stopped, finding)


def find_stopped_rows(values: Array, others: Sequence[Array]) -> Mask:
    """Rows (n,) of long stretches in which a sensor (n, 3) repeats one reading while others, each
    (n,) or (n, k), move; none of a sensor that hardly ever reads anything new."""
    fresh = find_changed(values)
    if fresh.sum() < MIN_ROWS:
        return np.zeros(len(values), dtype=bool)
    number = np.cumsum(fresh).astype(np.float64)
    return find_stuck_values(number, lambda: np.column_stack(others))


def check_clipping(samples: Samples) -> Finding | None:
    """The finding that the gyro reads one largest rate again and again: it turned faster. Not where
    readings repeat anyway, as those of a coarse gyro do."""
    rate = samples.rotation_rate
    if rate is None or len(rate) < MIN_ROWS:
        return None
    return next((one for axis in range(3) for one in find_facts([CLIPPING], rate, axis)), None)


def _measure_pinned(rate: Array, axis: int) -> Told:
    size = np.abs(rate[:, axis])
    pinned = size == size.max()
    free, share = size[~pinned], float(pinned.mean())
    if share < PINNED or len(free) < MIN_ROWS or (np.diff(free) == 0).mean() > PINNED:
        return None
    return {"top": float(np.degrees(size.max())), "axis": "xyz"[axis], "share": 100 * share}


CLIPPING = Fact(
    "inertial unit",
    _measure_pinned,
    "check",
    "the gyro never reads more than {top}°/s about {axis}, and just that in {share:.0f} % of the "
    "rows: it clips",
    "set a wider range of the gyro, or turn more slowly",
)
