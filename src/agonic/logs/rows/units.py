"""The unit of the field of a table: of its headers, given, or documented for its format."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError, UnitError
from agonic.logs.headers.columns import Identified
from agonic.logs.headers.header import Column
from agonic.logs.headers.words import FALLBACK
from agonic.logs.rows.auxiliary import Table
from agonic.units import RAW, find_unit, nanotesla_per

_UNIT = re.compile(r"[(\[{<][^()\[\]{}<>]*[^\W\d][^()\[\]{}<>]*[)\]}>]\s*$")
_STRONGEST = 1e8
"""nT. No magnetometer of a vehicle reads more: a documented unit was not kept to."""


def state_unit(found: Identified, table: Table) -> Identified:
    """The columns, those of the field with the unit that a column of units names, if rows agree.

    A unit that a header names goes before it.
    """
    column = found.get("unit", {}).get("", {}).get("")
    named = set() if column is None else {str(u).strip() for u in table[column.header]} - {""}
    if len(named) != 1:
        return found
    try:
        unit = find_unit(named.pop())
    except UnitError:
        return found
    fields = {
        sensor: {a: c if c.unit else replace(c, unit=unit) for a, c in axes.items()}
        for sensor, axes in found.get("field", {}).items()
    }
    return {**found, "field": fields}


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
