"""Whether the column of a scalar magnetometer can be the magnitude of the field."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.health.finding import Finding, figure
from agonic.health.resolution import find_steps
from agonic.health.scale import GAIN, MAGNITUDES_NT
from agonic.maths.one_pass import find_length, median
from agonic.samples import Samples

STUCK = 0.1
"""Share of the rows: one value for so long, where it else changes from row to row, is none read."""
COMPUTED_NT = 1e-3
"""A magnitude this near to that of the vector, beside both roundings, was computed from it."""


def check_scalar(samples: Samples) -> Finding | None:
    """Why the scalar column is no reading of the field's magnitude, None where it may be one.

    >>> field = 48_000.0 * np.eye(3)
    >>> dead = Samples(field=field, unit="nT", scalar=np.full(3, 48_000.0))
    >>> check_scalar(dead).what
    'the scalar instrument reads 48000 nT in all 3 rows'
    """
    scalar, size = samples.scalar, find_length(samples.field)
    assert scalar is not None
    runs = np.diff(np.flatnonzero(np.r_[True, np.diff(scalar) != 0, True]))
    first, what, move = figure(scalar[0], 6), "", ""
    if not (scalar > 0).any():
        what, move = "the scalar instrument reads nothing above zero", "it is off, or not locked"
    elif len(runs) == 1:
        what = f"the scalar instrument reads {first} nT in all {len(scalar)} rows"
        move = f"it is dead, or the number was typed in: --field {first} gives one"
    elif runs.max() > STUCK * len(scalar) and median(runs) == 1:
        what = f"the scalar instrument repeats one value in {runs.max()} rows on end"
        move = "it lost its lock there: leave those rows out (--between), or repair it"
    elif samples.unit == "nT" and _is_computed(samples, scalar, size):
        what = "the scalar column is the magnitude of the vector itself"
        move = "name the column of an instrument of its own"
    elif (off := _find_other_size(samples, median(scalar), size)) is not None:
        what, move = off, "check the unit in its header (F_nT, F_uT), and that it is the magnitude"
    return Finding("scale", "refuse", what, move) if what else None


def _is_computed(samples: Samples, scalar: Array, size: Array) -> bool:
    step = float(find_steps(scalar[:, None])[0])
    rounding = (step + float(np.linalg.norm(find_steps(samples.field)))) / 2
    return bool(np.abs(size - scalar).max() < COMPUTED_NT + rounding)


def _find_other_size(samples: Samples, usual: float, size: Array) -> str | None:
    """What the scalar usually reads, where that is no field, or not that of the vector."""
    read = f"the scalar instrument reads {figure(usual, 3)} nT"
    if samples.unit != "nT":
        within = MAGNITUDES_NT[0] < usual < MAGNITUDES_NT[1]
        return None if within else f"{read}, as no place on Earth has it"
    turned = median(find_length(samples.field - samples.field.mean(axis=0)))
    middle = median(size)
    if any(GAIN[0] < one / usual < GAIN[1] for one in (middle, turned)):
        return None
    off = usual / middle
    times = f"{figure(off)} times too large" if off > 1 else f"{figure(1 / off)} times too small"
    return f"{read} where the vector reads {figure(middle, 3)} nT, {times}"
