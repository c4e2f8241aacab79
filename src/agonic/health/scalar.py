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
    what, move = "", ""
    if not (scalar > 0).any():
        what, move = "the scalar instrument reads nothing above zero", "it is off, or not locked"
    elif np.ptp(scalar) == 0.0:
        what = f"the scalar instrument reads {figure(scalar[0], 6)} nT in all {len(scalar)} rows"
        move = f"it is dead, or the number was typed in: --field {figure(scalar[0], 6)} gives one"
    elif (rows := _find_longest(scalar)) > STUCK * len(scalar) and _find_usual(scalar) == 1:
        what = f"the scalar instrument repeats one value in {rows} rows on end"
        move = "it lost its lock there: leave those rows out (--between), or mend it"
    elif samples.unit == "nT" and _is_computed(samples, scalar, size):
        what = "the scalar column is the magnitude of the vector itself"
        move = "name the column of an instrument of its own"
    elif (low_or_high := _find_scale(samples, scalar, size)) is not None:
        what, move = low_or_high
    return Finding("scale", "refuse", what, move) if what else None


def _find_runs(scalar: Array) -> Array:
    """How many rows on end each value stands in."""
    edges = np.flatnonzero(np.r_[True, np.diff(scalar) != 0, True])
    return np.diff(edges)


def _find_longest(scalar: Array) -> int:
    return int(_find_runs(scalar).max())


def _find_usual(scalar: Array) -> float:
    return median(_find_runs(scalar))


def _is_computed(samples: Samples, scalar: Array, size: Array) -> bool:
    step = float(find_steps(scalar[:, None])[0])
    rounding = (step + float(np.linalg.norm(find_steps(samples.field)))) / 2
    return bool(np.abs(size - scalar).max() < COMPUTED_NT + rounding)


def _find_scale(samples: Samples, scalar: Array, size: Array) -> tuple[str, str] | None:
    """What speaks against the size of the scalar readings, and what to do about it."""
    usual = median(scalar)
    if samples.unit != "nT":
        low, high = MAGNITUDES_NT
        if low < usual < high:
            return None
        said = f"the scalar instrument reads {figure(usual, 3)} nT, as no place on Earth has it"
        return said, "check the unit in its header (F_nT, F_uT)"
    centre = samples.field.mean(axis=0)
    sizes = (median(size), median(find_length(samples.field - centre)))
    if any(GAIN[0] < one / usual < GAIN[1] for one in sizes):
        return None
    off = usual / sizes[0]
    times = f"{figure(off)} times too large" if off > 1 else f"{figure(1 / off)} times too small"
    return (
        f"the scalar instrument reads {figure(usual, 3)} nT where the vector reads "
        f"{figure(sizes[0], 3)} nT",
        f"its numbers are {times}: check the unit in its header (F_nT, F_uT), and that the column "
        "is the magnitude of the field",
    )
