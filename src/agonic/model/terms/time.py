"""Terms over time: drifts of bias, gains and field; rows that alternate."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.model.term import Errors, Seen, Term, along_time

COSINES = {"bias": 12, "gains": 4, "field": 16}
"""Cosines of the log's time, of sizes 1/j: a random walk's own (Karhunen–Loève)."""
ROWS_PER_COSINE = 20


def _cosines(seen: Seen, most: int) -> Array:
    count = max(min(most, len(seen.time) // ROWS_PER_COSINE), 1)
    found = np.ones((count + 1, len(seen.time)))
    found[1] = np.cos(np.pi * seen.time)
    for j in range(2, count + 1):  # cos jθ = 2 cos θ cos (j − 1)θ − cos (j − 2)θ
        found[j] = 2.0 * found[1] * found[j - 1] - found[j - 2]
    return found[1:] / np.arange(1, count + 1)[:, None]


def bias_drift(seen: Seen) -> Errors:
    """The bias walks."""
    return along_time(_cosines(seen, COSINES["bias"]))


def gain_drift(seen: Seen) -> Errors:
    """The gain of every axis walks."""
    return Errors(_cosines(seen, COSINES["gains"])[:, None] * (seen.x.T / seen.reach))


def field_change(seen: Seen) -> Errors:
    """The magnitude of the field walks."""
    return Errors(_cosines(seen, COSINES["field"])[:, None], apart=False, way=seen.unit.T)


def alternation(seen: Seen) -> Errors:
    """Even and odd rows differ in bias and gains: two sensors that take turns."""
    sign = np.where(seen.rows % 2, 1.0, -1.0)
    x = seen.x.T / seen.reach
    return Errors(np.stack([np.broadcast_to(sign, x.shape), sign * x]))


def no_errors(seen: Seen) -> None:
    """The columns of a step are made from the blocks of time (`gram.Blocks`)."""


TIME = (
    Term(
        name="bias drift",
        errors=bias_drift,
        scale=2e-3,
        source="100 nT while a sensor warms up by some degrees (RM3100, MMC5983 data sheets)",
        what="the bias moved during the log",
        move="let it warm up, keep iron and currents unchanged, keep away from magnets and steel, "
        "and record again",
        moves=True,
    ),
    Term(
        name="gain drift",
        errors=gain_drift,
        scale=2e-3,
        source="0.03 to 0.3 % a degree of uncompensated magnetoresistors",
        what="gains changed during the log",
        move="let it warm up and keep its settings unchanged, and record again",
        moves=True,
    ),
    Term(
        name="field variation",
        errors=field_change,
        scale=2e-3,
        source="daily variation and steel some metres off, 100 nT",
        what="the magnitude of the field was not the same throughout",
        move="keep the sensor in one place, away from steel and moving iron",
    ),
    Term(
        name="alternating rows",
        errors=alternation,
        scale=2e-3,
        source="offset left by set and reset in data sheets",
        what="even and odd rows differ: two sensors alternate, or set and reset",
        move="separate them (a sensor column, --sensor) and calibrate each by itself",
        moves=True,
    ),
)

STEP = Term(
    name="field changed",
    errors=no_errors,
    scale=5e-3,
    source="iron or a current that comes or goes",
    what="the bias moved: something magnetic, or a current, was added or removed",
    move="calibrate the stretches before and after separately, with everything in its final place",
    moves=True,
)
