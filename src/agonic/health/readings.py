"""What can be said of readings before any fit: one table, a row for each fact."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from agonic.health.decoding import find_decoding
from agonic.health.evidence import MIN_READINGS
from agonic.health.finding import Fact, Finding, Limit, Told, figure, find_facts
from agonic.health.scale import find_quantisation, measure_gravity
from agonic.health.sticking import Sticking, find_sticking, is_throughout
from agonic.maths.one_pass import find_length, median
from agonic.new_rows import find_changed
from agonic.samples import Samples

_STEADIEST = 3e-7
"""Relative scatter of the magnitude below which it was made, not measured; float32 has 6e-8."""
_UNREAD = ("times left out", "acc left out", "gyro left out")
"""How the notes of a reader begin on what it found and could not read."""


def inspect(samples: Samples) -> tuple[Finding, ...]:
    """Everything that the readings alone give away."""
    rejected = check_rejected(samples.rejected, len(samples) + sum(samples.rejected.values()))
    of_numbers = find_decoding(samples)
    return (*rejected, *of_numbers, *find_facts(FACTS, samples, find_sticking(samples.field)))


def describe(samples: Samples) -> tuple[Finding, ...]:
    """What `inspect` finds and what is merely worth knowing: steps, a correction in the log."""
    return (*inspect(samples), *find_facts(WORTH_KNOWING, samples))


def check_rejected(rejected: Mapping[str, int], total: int) -> list[Finding]:
    """Rows of so many that hold no number or no time of their own, by the reason."""
    return [
        Finding(
            "NaN" if "NaN" in why or "scalar" in why else "torn end" if "ends" in why else "clock",
            "check" if (many := count > 0.01 * total and "scalar" not in why) else "note",
            f"{count} of {total} rows were left out ({why})",
            "look at the logger" if many else "",
        )
        for why, count in rejected.items()
        if count
    ]


def _measure_stuck(samples: Samples, sticking: Sticking, axis: int) -> Told:
    """An axis that stands still, throughout or for a time, while the others move."""
    if axis >= len(samples.axes) or not (rows := sticking.stuck[axis]).any():
        return None
    what = (
        f"stands still while the others move, in {int(rows.sum())} readings "
        f"from row {int(np.argmax(rows))} on, which were left out"
    )
    move, dead = "check the sensor and its wiring", is_throughout(rows)
    if dead:
        what = f"{'never' if rows.all() else 'hardly ever'} changes while the others do"
        if len(samples.axes) == 3:
            move += "; with two axes it can only be used as a level compass"
    return {"value": float(dead), "what": what, "move": move}


def _measure_clipped(samples: Samples, sticking: Sticking) -> Told:
    clipped = sticking.clipped & ~np.any(sticking.stuck[: len(samples.axes)], axis=0)
    count = int(clipped.sum())
    return {"count": count, "share": 100 * count / len(clipped)} if count else None


def _measure_dead_zones(samples: Samples, sticking: Sticking) -> Told:
    where = (
        f"{'xyz'[zone.axis]} at {figure(zone.level)} (between {figure(zone.low)} and "
        f"{figure(zone.high)} {samples.unit})"
        for zone in sticking.zones[:3]
    )
    count = int(sticking.in_zones.sum())
    return {"where": " and ".join(where), "count": count} if sticking.zones else None


def _measure_repeated(samples: Samples, _: Sticking) -> Told:
    repeats = len(samples) - np.count_nonzero(find_changed(samples.field))
    return 100 * repeats / max(len(samples) - 1, 1)


def _measure_gaps(samples: Samples, _: Sticking) -> Told:
    if samples.time is None or len(samples) < MIN_READINGS:
        return None
    steps = np.diff(samples.time)
    count = int((steps > max(20 * median(steps), 1.0)).sum())
    return {"many": f"{count} gap{'s' * (count > 1)}", "longest": steps.max()} if count else None


def _measure_unread(samples: Samples, _: Sticking) -> Told:
    unread = [note for note in samples.notes if note.startswith(_UNREAD)]
    return {"notes": "; ".join(unread)} if unread else None


def _measure_normalised(samples: Samples, _: Sticking) -> Told:
    """Whether a driver has divided readings by their own length. No sensor is so steady: even in
    one place its noise is some parts in 10⁵."""
    size = find_length(samples.field)
    middle = float(size.mean()) if len(size) >= MIN_READINGS else 0.0
    turned = np.ptp(samples.field, axis=0).max(initial=0.0) > 0.1 * middle
    made = 0 < middle < np.inf and turned and float(size.std()) <= _STEADIEST * middle
    return {} if made else None


FACTS = (
    Fact(
        "scale",
        measure_gravity,
        "refuse",
        "x, y and z are {size} in size about zero in every direction, as an accelerometer reads "
        "gravity",
        "are they the magnetometer? say so with --columns x=…,y=…,z=… or name its columns",
    ),
    Fact(
        "too few readings",
        lambda samples, _: {"count": len(samples)} if len(samples) < MIN_READINGS else None,
        "refuse",
        "only {count} readings: with nine unknowns none are left to check the result",
        "record at least a few hundred while turning the sensor about all axes",
    ),
    *(
        Fact(
            "frozen axis",
            partial(_measure_stuck, axis=axis),
            Limit(-1.0, 0.0),  # stuck for a time, dead throughout
            f"axis {name} {{what}}",
            "{move}",
        )
        for axis, name in enumerate("xyz")
    ),
    Fact(
        "clipping",
        _measure_clipped,
        "check",
        "{count} readings ({share:.1f} %) sit at the end of the sensor's range and were left out",
        "choose a larger range, or move the sensor away from magnets and iron",
    ),
    Fact(
        "dead zone",
        _measure_dead_zones,
        "check",
        "an axis sticks at one reading while the others move: {where}, in {count} readings, which "
        "were left out; a heading from such readings is wrong, whatever the calibration",
        "check whether a driver or a filter cuts small readings off, or replace the sensor",
    ),
    Fact(
        "repeated readings",
        _measure_repeated,
        Limit(note=5.0),
        "{value:.0f} % of the readings repeat the one before: the log runs faster than the sensor",
    ),
    Fact("gaps", _measure_gaps, "note", "{many} in time, the longest {longest:.1f} s"),
    Fact(
        "corrected readings",
        lambda samples, _: {} if samples.corrected else None,
        "check",
        "the autopilot or the device had corrected these readings in a way that the log does not "
        "state, so the result comes on top of that correction and is not exported to an autopilot",
        "record uncorrected readings, or calibrate from the vehicle's own log, or join the result "
        "and the parameters in force then (agonic export --on OLD.param)",
    ),
    Fact(
        "not read",
        _measure_unread,
        "note",
        "not all of the log could be read: {notes}",
        "the result is from the rest; name columns and units in the header, or with --columns",
    ),
    Fact(
        "normalised",
        _measure_normalised,
        "refuse",
        "all readings have exactly the same length: they were normalised, and the information on "
        "bias and soft iron is lost",
        "have the driver record the readings as measured",
    ),
)
"""Of samples and the rows in which their axes stick."""


def _measure_steps(samples: Samples) -> Told:
    size = find_quantisation(samples.field)
    return None if size is None else {"size": size, "unit": samples.unit}


WORTH_KNOWING = (
    Fact("coarse steps", _measure_steps, "note", "readings come in steps of {size:.4g} {unit}"),
    Fact(
        "already corrected",
        lambda samples: samples.logged and {"source": samples.logged.source},
        "note",
        "the log holds readings corrected by {source}; raw ones recovered",
    ),
)
