"""The unit of the field of a table: of its headers, given, or documented for its format."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.columns import FALLBACK, Column
from agonic.units import RAW, find_unit, nanotesla_per

_STRONGEST = 1e8
"""nT. No magnetometer of a vehicle reads more: a documented unit was not kept to."""


def find_field_unit(
    axes: Mapping[str, Column], given: str | None, field: Array
) -> tuple[str, tuple[str, ...]]:
    """The unit that the headers name, else the given or the documented one, else raw."""
    units = {column.unit for column in axes.values()}
    if len(units) > 1:
        headers = ", ".join(column.header for column in axes.values())
        raise LogError(f"the axes are in different units ({headers}); give them one")
    named = units.pop()
    bare = ("no column is named for a magnetometer: x, y and z are taken as one",)
    notes = bare if named is None and axes["x"].rank == FALLBACK else ()
    if named in (None, RAW):
        if given is None:
            return RAW, (*notes, "the table names no unit: the field is left in raw units")
        return given, notes
    if documented := axes["x"].documented:
        return _documented_unit(named, documented, given, field)
    if given is not None and find_unit(given) != named:
        return named, (f"the headers say {named}: the given unit {given} is not used",)
    return named, ()


def _documented_unit(
    unit: str, name: str, given: str | None, field: Array
) -> tuple[str, tuple[str, ...]]:
    """The given unit, else the documented one where readings of that size can be."""
    if given is not None:
        return given, (f"{name} documents {unit}: the given unit {given} goes before it",)
    size = float(np.nanmedian(np.abs(field))) if np.isfinite(field).any() else 0.0
    if size * nanotesla_per(unit) > _STRONGEST:
        return RAW, (
            f"{name} documents {unit}, and readings of {size:.3g} {unit} cannot be: the field is "
            "left in raw units; give --unit",
        )
    return unit, ()
