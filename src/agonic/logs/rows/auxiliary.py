"""Columns beside the magnetometer's: into our unit, within their range, without holes.

A column that was recorded more slowly, or not all the time, must not cost readings of the
magnetometer. Short holes are filled from the neighbours; a column with more than a few other
holes is left out, and a note says so.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Mask
from agonic.errors import LogError, UnitError
from agonic.logs.contents import to_number
from agonic.logs.headers.columns import Identified, map_columns
from agonic.logs.headers.header import Column
from agonic.logs.headers.quantities import FALLBACK, Linear
from agonic.logs.log import Table
from agonic.logs.rows.resample import interpolate_smoothly, resample
from agonic.maths.one_pass import median
from agonic.units import RAW, STANDARD_GRAVITY_M_S2, find_unit, nanotesla_per

ATTITUDE = ("roll_deg", "pitch_deg", "heading_deg")
PERIODS_DEG = dict.fromkeys((*ATTITUDE, "longitude_deg"), 360.0)
_SLOW = ("temperature", "latitude_deg", "longitude_deg", "altitude_m")
_REACH_S = dict.fromkeys(_SLOW, 60.0)
SHORT_REACH_S = 0.5
_FEW = 0.01
"""Share of the readings that a column may still cost after its short holes are filled."""
MOST_OF_THE_ROWS = 0.5
"""With the scalar instrument on in so many of the rows, the others are given up for it."""
_JOINED = 1.5
"""Of its usual interval: readings of a scalar instrument farther apart have a gap between them."""
_NEW_SHARE = 0.6
"""Of the rows: where fewer hold a new scalar reading, and at even steps, the others repeat it."""
_EVEN = 0.9
"""Share of the steps between new readings that are even, to half of the usual one."""


def find_finite_rows(values: Array) -> Mask:
    """The rows (n,) of an array (n, k) that are finite; fast where that is all."""
    if len(values) and np.isfinite(max(-values.min(), values.max())):
        return np.ones(len(values), dtype=bool)
    return np.asarray(np.isfinite(values).all(axis=1))


def find_reach(column: str, known: Array) -> float:
    """How far, s, neighbours recorded at `known` times may be from a row that is filled from them.
    A scalar instrument measures at a pace of its own; what joins its readings is that pace."""
    if column == "scalar" and len(known) > 1:
        return max(_JOINED * median(np.diff(known)), SHORT_REACH_S)
    return _REACH_S.get(column, SHORT_REACH_S)


_RAW = ("raw", "counts")
_GRAVITY_UNITS = {"m/s²": 1.0, "g": STANDARD_GRAVITY_M_S2, "mg": STANDARD_GRAVITY_M_S2 * 1e-3}


def to_numbers(values: NDArray[Any]) -> Array:
    """A column as float64; a text that is no number becomes NaN, d:m:s becomes degrees."""
    if values.dtype.kind not in "OUS":
        return np.asarray(values, dtype=np.float64)
    numbers = []
    for plain in (str(value).strip().strip("\"'") for value in values):
        size = sum(abs(to_number(part)) / 60.0**i for i, part in enumerate(plain.split(":")))
        numbers.append(-size if plain.startswith("-") else size)
    return np.array(numbers, dtype=np.float64)


def number_labels(values: NDArray[Any]) -> Array:
    """Numbers of labels: themselves, or 1, 2, … where they are words; 0 where there is none."""
    if values.dtype.kind not in "OUS":
        return np.nan_to_num(np.asarray(values, dtype=np.float64))
    labels = [str(value).strip() for value in values]
    numbers = to_numbers(np.array([label or "0" for label in labels]))
    if np.isfinite(numbers).all():
        return numbers
    known = {label: k for k, label in enumerate(sorted({*labels} - {""}), start=1)}
    return np.array([known.get(label, 0.0) for label in labels], dtype=np.float64)


def set_angle_unit(found: Identified, table: Table) -> Identified:
    """The columns, with attitude that names no unit in degrees where it exceeds one turn in rad."""
    attitude = [axes[""] for name in ATTITUDE for axes in found.get(name, {}).values()]
    unnamed = [to_numbers(table[column.header]) for column in attitude if column.unit is None]
    if not any((np.abs(values) > 2 * np.pi).any() for values in unnamed):
        return found
    return map_columns(
        found, lambda c: replace(c, unit=c.unit or "deg") if c.quantity.column in ATTITUDE else c
    )


def convert_column(
    axes: Mapping[str, Column],
    values: Array,
    time: Array | None,
    readings: Mask,
    *,
    keep_holes: bool = False,
) -> tuple[Array | None, tuple[str, ...]]:
    """The values of one quantity in our unit, (n,) or (n, 3), or `None`; and notes on them. `axes`
    are its columns and `values` (n, k) what they hold, in that order; `readings` marks the rows
    that have a magnetometer reading. With `keep_holes` a column with many holes is not given up:
    they stay NaN."""
    quantity = next(iter(axes.values())).quantity
    scale, remark = _find_scale(axes, values)
    if scale is None:
        return None, (f"{quantity.name} left out: {remark}",)
    factor, offset = scale
    ours = values * factor + offset
    if quantity.column == "acceleration" and _find_usual_size(ours) < 0.5 * STANDARD_GRAVITY_M_S2:
        return None, (f"{quantity.name} left out: it is without gravity",)
    low, high = quantity.range
    ours[(ours < low) | (ours > high)] = np.nan
    repeated = ""
    if quantity.column == "scalar" and time is not None:
        ours, repeated = forget_repeated(ours, time)
    filled, gaps = fill_holes(quantity.column, ours, time, readings, keep_holes=keep_holes)
    notes = tuple(f"{quantity.name} {text}" for text in (remark, repeated, gaps) if text)
    return (filled if filled is None or quantity.vector else filled[:, 0]), notes


def forget_repeated(values: Array, time: Array) -> tuple[Array, str]:
    """Readings (n, 1) of an instrument that is slower than the log, NaN where a row repeats the one
    before until the next has come, and a note; as they are where they are no such steps."""
    known = np.isfinite(values[:, 0])
    rows = np.flatnonzero(known)
    new = rows[np.r_[True, np.diff(values[rows, 0]) != 0]] if len(rows) else rows
    steps = np.diff(time[new])
    if len(new) > _NEW_SHARE * len(rows) or len(steps) < 2:
        return values, ""
    usual = median(steps)
    if np.mean(np.abs(steps - usual) < usual / 2) < _EVEN:
        return values, ""
    fresh = np.full_like(values, np.nan)
    fresh[new] = values[new]
    return fresh, f"is new every {usual:.3g} s"


def _find_scale(axes: Mapping[str, Column], values: Array) -> tuple[Linear | None, str]:
    """Factor and offset to our unit, and a remark; no scale where it cannot be known."""
    units = {column.unit for column in axes.values()}
    quantity = next(iter(axes.values())).quantity
    if quantity.vector and set(axes) != set("xyz"):
        return None, "it has not all of x, y and z"
    if quantity.vector and not np.nan_to_num(values).any():
        return None, "it is zero throughout"
    if len(units) > 1:
        return None, "its axes are in different units"
    unit = units.pop()
    if unit is not None and unit not in _RAW:
        return quantity.units[unit], ""
    if quantity.column == "acceleration":
        usual = _find_usual_size(values)
        for unit, factor in _GRAVITY_UNITS.items():
            if abs(usual * factor / STANDARD_GRAVITY_M_S2 - 1.0) < 0.2:
                return (factor, 0.0), f"names no unit; its size is that of gravity in {unit}"
        return None, f"its header names no unit and its size, {usual:.4g}, is not that of gravity"
    if quantity.column == "rotation_rate" or quantity.column in ATTITUDE:
        return None, "its header names neither degrees nor radians"
    if quantity.column == "scalar":
        return None, "its header names no unit"
    return (1.0, 0.0), ""


def _find_usual_size(vectors: Array) -> float:
    """The median length of vectors (n, 3); NaN where none is known."""
    sizes = np.linalg.norm(vectors[find_finite_rows(vectors)], axis=1)
    return median(sizes) if len(sizes) else np.nan


def fill_holes(
    column: str, values: Array, time: Array | None, readings: Mask, *, keep_holes: bool = False
) -> tuple[Array | None, str]:
    """The values (n, k) with short holes filled, or `None` where too many would be missing. With
    `keep_holes` they are returned however many are missing."""
    known = np.asarray(np.isfinite(values).all(axis=1))
    holes = readings & ~known
    if not holes.any():
        return values, ""
    near = np.zeros_like(holes)
    if time is not None and column in _SLOW:
        time = _complete(time)
    if time is not None:
        known = known & np.isfinite(time)
    if time is not None and known.any():
        near = holes & (measure_reach(time[known], time) <= find_reach(column, time[known]))
        if column == "scalar":  # which changes too fast to be held at its ends
            near &= (time >= time[known].min()) & (time <= time[known].max())
        fresh = [
            interpolate_smoothly(time[near], time[known], v[known])
            if column == "scalar"
            else resample(time[known], v[known], time[near], period=PERIODS_DEG.get(column))
            for v in values.T
        ]
        values = values.copy()
        values[near] = np.stack([v for v in fresh if v is not None], axis=1)
    left = int((holes & ~near).sum())
    most = 1 - MOST_OF_THE_ROWS if column == "scalar" else _FEW
    if left > most * readings.sum() and not keep_holes:
        return None, f"left out: missing in {holes.sum()} of {readings.sum()} rows"
    return values, f"filled from neighbours in {near.sum()} rows" if near.any() else ""


def _complete(time: Array) -> Array:
    """Times with those of other clocks by the place of their rows, near enough for slow columns."""
    known = np.isfinite(time)
    if known.all() or not known.any():
        return time
    rows = np.arange(len(time))
    return np.interp(rows, rows[known], time[known])


def measure_reach(known: Array, wanted: Array) -> Array:
    """Seconds to the farther of the two known times around each wanted one; at an end, to one."""
    order = np.sort(known)
    after = np.searchsorted(order, wanted)
    sides = [order[np.clip(after + k, 0, len(order) - 1)] for k in (-1, 0)]
    return np.asarray(np.max([np.abs(wanted - side) for side in sides], axis=0))


_UNIT = re.compile(r"[(\[{<][^()\[\]{}<>]*[^\W\d][^()\[\]{}<>]*[)\]}>]\s*$")
_STRONGEST = 1e8
"""nT. No magnetometer of a vehicle reads more: a documented unit was not kept to."""


def state_unit(found: Identified, table: Table) -> Identified:
    """The columns, those of the field with the unit that a column of units names, if rows agree. A
    unit that a header names goes before it."""
    column = found.get("unit", {}).get("", {}).get("")
    named = set() if column is None else {str(u).strip() for u in table[column.header]} - {""}
    if len(named) != 1:
        return found
    try:
        unit = find_unit(named.pop())
    except UnitError:
        return found
    return map_columns(
        found, lambda c: replace(c, unit=c.unit or unit) if c.quantity.column == "field" else c
    )


def find_field_unit(
    axes: Mapping[str, Column], given: str | None, field: Array
) -> tuple[str, tuple[str, ...]]:
    """The unit that the headers name, else the given or the documented one, else raw."""
    units = {column.unit for column in axes.values()}
    if len(units) > 1:
        headers = ", ".join(column.header for column in axes.values())
        raise LogError(f"the axes are in different units ({headers}); give them one")
    named = units.pop()
    x, y, z = (axes[axis].header if axis in axes else "" for axis in "xyz")
    bare = (f"no column is named for a magnetometer: {x}, {y} and {z} are taken as one",)
    notes = bare if named is None and axes["x"].rank == FALLBACK else ()
    if named in (None, RAW):
        if given is not None:
            return given, notes
        unknown = named is None and _UNIT.search(x)
        no = f"the unit of {x!r} is not known" if unknown else "the table names no unit"
        return RAW, (*notes, f"{no}: the field is left in raw units")
    if documented := axes["x"].documented:
        return _choose_documented_unit(named, documented, given, field)
    if given is not None and find_unit(given) != named:
        return named, (f"the headers say {named}: the given unit {given} is not used",)
    return named, ()


def _choose_documented_unit(
    unit: str, name: str, given: str | None, field: Array
) -> tuple[str, tuple[str, ...]]:
    """The given unit, else the documented one where readings of that size can be."""
    if given is not None:
        return given, (f"{name} documents {unit}: the given unit {given} is used instead",)
    size = float(np.nanmedian(np.abs(field))) if np.isfinite(field).any() else 0.0
    if size * nanotesla_per(unit) > _STRONGEST:
        return RAW, (
            f"{name} documents {unit}, and readings of {size:.3g} {unit} cannot be: the field is "
            "left in raw units; give --unit",
        )
    return unit, ()
