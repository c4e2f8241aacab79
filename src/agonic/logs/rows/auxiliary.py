"""Columns beside the magnetometer's: at its rows, in our unit, within their range, without holes.

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
from numpy.typing import ArrayLike, NDArray

from agonic.arrays import Array, Mask
from agonic.errors import LogError, UnitError
from agonic.logs.contents import to_number
from agonic.logs.headers.columns import Identified, map_columns
from agonic.logs.headers.header import Column
from agonic.logs.headers.quantities import FALLBACK, Linear
from agonic.logs.log import Table
from agonic.maths.one_pass import interpolate, median
from agonic.units import RAW, STANDARD_GRAVITY_M_S2, find_unit, nanotesla_per

ESTIMATED_ATTITUDE = (
    "roll, pitch and heading are the autopilot's own estimate, which itself follows its compasses"
)

LONGEST_LOG_S = 1e10
"""Three centuries: a time farther than this from the others is damaged."""


def resample(
    time_from: ArrayLike, values: ArrayLike, time_to: ArrayLike, *, period: float | None = None
) -> Array | None:
    """Values (n,) or (n, 3) at other times (m,), by linear interpolation between finite rows;
    before and after, the end values hold. Angles, marked by their `period`, go the short way round
    and keep their range: 0…period where none is negative, else ±period/2. `None` without rows."""
    t, v, wanted = (np.asarray(a, dtype=np.float64) for a in (time_from, values, time_to))
    usable = np.isfinite(t) & np.isfinite(v).reshape(len(v), -1).all(axis=1)
    if not usable.any():
        return None
    order = np.flatnonzero(usable)[np.argsort(t[usable], kind="stable")]
    t, v = t[order], v[order]
    if period is not None:
        lowest = 0.0 if (v >= 0).all() else -period / 2
        turned = np.interp(wanted, t, np.unwrap(v, period=period))
        return np.asarray(lowest + (turned - lowest) % period)
    return interpolate(wanted, t, v)


def interpolate_smoothly(wanted: Array, time: Array, values: Array) -> Array:
    """Values (n,) at wanted times (m,) within their own (n,), by cubics that meet with one slope.
    Between readings of a field that bends, lines are off by F'' Δt²/8 to one side, which a fit
    takes for an offset; here an error is of the third order, and noise spreads two readings far.
    Source: Catmull & Rom, "A class of local interpolating splines", 1974."""
    from scipy.interpolate import CubicHermiteSpline  # slow to load

    if len(time) < 3:
        return interpolate(wanted, time, values)
    return np.asarray(CubicHermiteSpline(time, values, np.gradient(values, time))(wanted))


def find_misplaced(time: ArrayLike) -> Mask:
    """Rows whose time lies outside that of both neighbours although those are in order. Of the
    first row: later than the two after it, which are in order. Farther than `LONGEST_LOG_S` from
    the median is misplaced anywhere. One damaged time would otherwise cost every row after it,
    since times must increase."""
    t = np.asarray(time, dtype=np.float64)
    known = t[np.isfinite(t)]
    if not len(known):
        return np.zeros(len(t), dtype=bool)
    with np.errstate(over="ignore", invalid="ignore"):
        wrong = np.abs(t - np.median(known)) > LONGEST_LOG_S
    before, here, after = t[:-2], t[1:-1], t[2:]
    wrong[1:-1] |= (before <= after) & ((here < before) | (here > after))
    wrong[:1] |= t[:1] > t[2:3] if len(t) > 2 and t[1] < t[2] else False
    return wrong


ATTITUDE = ("roll_deg", "pitch_deg", "heading_deg")
PERIODS_DEG = dict.fromkeys((*ATTITUDE, "longitude_deg"), 360.0)
_REACH_S = dict.fromkeys(("temperature", "latitude_deg", "longitude_deg", "altitude_m"), 60.0)
SHORT_REACH_S = 0.5
_FEW = 0.01
"""Share of the readings that a column may still cost after its short holes are filled."""
MOST_OF_THE_ROWS = 0.5
"""With the scalar instrument on in so many of the rows, the others are given up for it."""


def find_finite_rows(values: Array) -> Mask:
    """The rows (n,) of an array (n, k) that are finite; fast where that is all."""
    if len(values) and np.isfinite(max(-values.min(), values.max())):
        return np.ones(len(values), dtype=bool)
    return np.asarray(np.isfinite(values).all(axis=1))


def find_reach(column: str, known: Array) -> float:
    """How far, s, neighbours recorded at `known` times may be from a row that is filled from them.
    A scalar instrument has a pace of its own, which joins its readings, and half as much again."""
    if column == "scalar" and len(known) > 1:
        return max(1.5 * median(np.diff(known)), SHORT_REACH_S)
    return _REACH_S.get(column, SHORT_REACH_S)


def to_numbers(values: NDArray[Any]) -> Array:
    """A column as float64; a text that is no number becomes NaN, d:m:s becomes degrees."""
    if values.dtype.kind not in "OUS":
        return np.asarray(values, dtype=np.float64)
    plain = [str(value).strip().strip("\"'") for value in values]
    sizes = [sum(abs(to_number(p)) / 60.0**i for i, p in enumerate(t.split(":"))) for t in plain]
    signs = [-1.0 if text.startswith("-") else 1.0 for text in plain]
    return np.array(signs) * np.array(sizes, dtype=np.float64)


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
    before until the next has come, and a note; as they are where more than 6 of 10 rows are new, or
    less than 9 of 10 steps between new ones are even, to half of the usual one."""
    known = np.isfinite(values[:, 0])
    rows = np.flatnonzero(known)
    new = rows[np.r_[True, np.diff(values[rows, 0]) != 0]] if len(rows) else rows
    steps = np.diff(time[new])
    if len(new) > 0.6 * len(rows) or len(steps) < 2:
        return values, ""
    usual = median(steps)
    if np.mean(np.abs(steps - usual) < usual / 2) < 0.9:
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
    if unit is not None and unit not in ("raw", "counts"):
        return quantity.units[unit], ""
    if quantity.column == "acceleration":
        usual = _find_usual_size(values)
        for said, unit in (("m/s²", "ms2"), ("g", "g"), ("mg", "mg")):
            factor, _ = quantity.units[unit]
            if abs(usual * factor / STANDARD_GRAVITY_M_S2 - 1.0) < 0.2:
                return (factor, 0.0), f"names no unit; its size is that of gravity in {said}"
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
    if time is not None and column in _REACH_S:
        there = np.isfinite(time)  # times of other clocks by the place of their rows
        rows = np.arange(len(time))
        time = np.interp(rows, rows[there], time[there]) if there.any() else time
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


def measure_reach(known: Array, wanted: Array) -> Array:
    """Seconds to the farther of the two known times around each wanted one; at an end, to one."""
    order = np.sort(known)
    after = np.searchsorted(order, wanted)
    sides = [order[np.clip(after + k, 0, len(order) - 1)] for k in (-1, 0)]
    return np.asarray(np.max([np.abs(wanted - side) for side in sides], axis=0))


_UNIT = re.compile(r"[(\[{<][^()\[\]{}<>]*[^\W\d][^()\[\]{}<>]*[)\]}>]\s*$")


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
    if size * nanotesla_per(unit) > 1e8:  # nT, more than any magnetometer of a vehicle reads
        return RAW, (
            f"{name} documents {unit}, and readings of {size:.3g} {unit} cannot be: the field is "
            "left in raw units; give --unit",
        )
    return unit, ()
