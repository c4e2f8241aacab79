"""Named variables with units, as CDF and netCDF files hold them, made into a log."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError, UnitError
from agonic.logs.arrays import stacked
from agonic.logs.clocks.clock import UNIX, read_clock, to_moments
from agonic.logs.contents import to_number
from agonic.logs.groups import Found
from agonic.logs.headers.columns import refuse_many
from agonic.logs.headers.header import name_quantity
from agonic.logs.headers.quantities import DOCUMENT
from agonic.logs.log import About
from agonic.logs.space.products import find_spacecraft, is_spacecraft
from agonic.units import RAW, find_unit, nanotesla_per

Variables = Mapping[str, NDArray[Any]]

FILL = 1e30
"""Floating numbers of at least this size stand for missing ones in CDF (−1e31) and netCDF."""

_SPELLINGS = {
    theirs: ours for ours, words in DOCUMENT["spellings"].items() for theirs in words.split()
}


def find_variables(variables: Variables, units: Mapping[str, str], about: About) -> Found:
    """The tables that variables are: as magnetic satellites name them, or as a table's columns.
    `units` of the variables by name, where the file says; moments are datetime64."""
    if not variables and about.get("notes"):
        raise LogError(f"{about['notes'][0]}; fetch it again")
    if stacked.is_broad(variables):
        return stacked.find_tables(variables, {**about, "notes": ()})
    known: dict[str, NDArray[Any]] = {}
    for name, values in variables.items():
        if values.ndim or stacked.is_sampling_rate(name):
            floating = values.dtype.kind == "f"
            known[name] = np.where(np.abs(values) < FILL, values, np.nan) if floating else values
    if not known:
        raise LogError("there are no variables in it; fetch the file again")
    spelled = {name: _SPELLINGS.get(text.strip().lower(), text) for name, text in units.items()}
    if not is_spacecraft(known):
        headed = {_header(n, v, spelled.get(n, "")): v for n, v in known.items()}
        return stacked.find_tables(_add_clock(headed, "time"), about)
    ours = {name: _convert_unit(name, known[name], spelled.get(name, "")) for name in known}
    try:
        with np.errstate(all="ignore"):
            return find_spacecraft(_add_clock(ours, "Timestamp"), about)
    except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:  # beyond all bounds
        raise LogError(f"the numbers in it make no sense ({error}); fetch it again") from error


def _convert_unit(name: str, values: NDArray[Any], unit: str) -> NDArray[Any]:
    """Lengths in m and fields in nT; variables of other kinds as they are."""
    if name == "Radius":
        return values * (1e3 if unit == "km" else 1.0)
    with suppress(UnitError):
        if values.dtype.kind == "f" and find_unit(unit) != RAW:
            return values * nanotesla_per(unit)
    return values


def _add_clock(variables: Variables, name: str) -> dict[str, NDArray[Any]]:
    """The variables with the first that holds moments under that name, unless it is taken."""
    moments = [n for n, values in variables.items() if values.dtype.kind == "M"]
    if not moments or name in moments:
        return dict(variables)
    return {name if n == moments[0] else n: values for n, values in variables.items()}


def _header(name: str, values: NDArray[Any], unit: str) -> str:
    """The name with the unit behind it, where that can be understood, as a column's header."""
    headed = f"{name}_{unit}"
    return headed if unit and name_quantity(headed + "[0]" * (values.ndim == 2)) else name


def read_tables(path: Path) -> Found:
    """The tables of a text of VirES; the service writes nT, degrees and metres."""
    header, *lines = path.read_bytes().decode("latin-1").replace("\r\n", "\n").split("\n")
    names = header.split(",")
    refuse_many(len(names))
    rows = [cells for line in lines if len(cells := line.split(",")) == len(names)]
    lost = sum(bool(line.strip()) for line in lines) - len(rows)
    if not rows:
        raise LogError("there is a header and no whole row below it; fetch it again")
    notes = (f"{lost} rows are not whole: left out",) if lost else ()
    columns = {
        name: _column(name, cells)
        for name, cells in zip(names, zip(*rows, strict=True), strict=True)
    }
    variables = {name: values for name, values in columns.items() if values is not None}
    return find_variables(variables, {}, {"format": "VirES text table", "notes": notes})


def _column(name: str, cells: tuple[str, ...]) -> NDArray[Any] | None:
    """Moments, texts, vectors (n, k) or numbers; `None` where vectors differ in length."""
    if name == "Spacecraft":
        return np.array(cells, dtype=object)
    if name == "Timestamp":
        seconds, epoch, _ = read_clock(np.array(cells, dtype=object), None)
        if seconds is None or epoch is None:
            raise LogError(f"the time {cells[0][:40]!r} cannot be read; fetch the file again")
        return to_moments((seconds + (epoch - UNIX).total_seconds()) * 1e6)
    parts = [cell.strip("{} ").split(";") for cell in cells]
    width = max(set(map(len, parts)), key=[len(p) for p in parts].count)
    values = [[to_number(x) for x in p] if len(p) == width else [np.nan] * width for p in parts]
    return np.array(values)[:, 0] if width == 1 else np.array(values)
