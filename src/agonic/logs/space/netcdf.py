"""netCDF files: version 4, which is HDF5, with h5py; version 3 with SciPy.

Times follow the CF conventions ("seconds since 2026-01-01"), as do scale, offset and fill value.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.errors import LogError, MissingExtraError
from agonic.logs.arrays.stacked import is_sampling_rate
from agonic.logs.arrays.stored import Place, check_heaps, fetch, list_items, read_values
from agonic.logs.child_process import call
from agonic.logs.clocks.clock import read_clock, to_moments
from agonic.logs.contents import explain_damage
from agonic.logs.groups import Found
from agonic.logs.headers.columns import refuse_many
from agonic.logs.space.variables import find_variables

CLASSIC = (b"CDF\x01", b"CDF\x02")

_SINCE = re.compile(r"\s*(?P<unit>[a-z]+)\s+since\s+(?P<start>.+)", re.IGNORECASE)
_UNITS = {"min": 60.0, "mil": 1e-3, "ms": 1e-3, "mic": 1e-6, "us": 1e-6, "n": 1e-9, "d": 86_400.0,
          "h": 3600.0, "s": 1.0}  # fmt: skip
"""Seconds of units of time, by how their names begin."""
_ATTRIBUTES = ("units", "scale_factor", "add_offset", "_FillValue", "missing_value")
_DIMENSION = b"This is a netCDF dimension but not a netCDF variable"

Variable = tuple[NDArray[Any] | Place, Mapping[str, Any]]
"""The values of a variable, or their place, and its attributes."""


def read_tables(path: Path) -> Found:
    """The tables that the variables of a netCDF file are."""
    with path.open("rb") as stream:
        classic = stream.read(4) in CLASSIC
    if not classic and find_spec("h5py") is None:
        raise MissingExtraError("reading a netCDF-4 file", "space")
    with explain_damage("cannot be read as netCDF"):
        found, notes = _read_version_3(path) if classic else call(read_version_4, path)
    variables = {name: _decode(fetch(values), said) for name, (values, said) in found.items()}
    units = {name: _text(attributes.get("units", "")) for name, (_, attributes) in found.items()}
    return find_variables(variables, units, {"format": "netCDF", "notes": tuple(notes)})


def read_version_4(path: Path) -> tuple[dict[str, Variable], list[str]]:
    """The variables of one or two dimensions, those of groups by `group.name`, and notes."""
    import h5py

    check_heaps(path)
    found: dict[str, Variable] = {}
    notes: list[str] = []
    with h5py.File(path, "r") as file:
        items = list_items(file)
        for group in [name for name, item in items.items() if isinstance(item, h5py.Group)]:
            items |= {
                f"{group}.{name}": item for name, item in list_items(items.pop(group)).items()
            }
        refuse_many(len(items), "variables")
        deeper = [name for name, item in items.items() if isinstance(item, h5py.Group)]
        items = {name: item for name, item in items.items() if isinstance(item, h5py.Dataset)}
        if deeper and not items:
            raise LogError(
                f"its values lie in groups within groups ({', '.join(deeper[:3])[:200]}), which "
                "are not read; write each sensor to a file of its own, such as CSV"
            )
        for name in filter(is_sampling_rate, file.attrs):
            if np.prod(file.attrs.get_id(name).shape) == 1:
                found[name] = np.asarray(file.attrs[name]).reshape(()), {}
        for name, item in items.items():
            try:
                wanted = (is_sampling_rate(name) and item.ndim == 0) or 1 <= item.ndim <= 2
                named = "NAME" in item.attrs and item.attrs.get_id("NAME").dtype.kind == "S"
                if wanted and not (named and item.attrs["NAME"].startswith(_DIMENSION)):
                    found[name] = read_values(item), _attributes(item.attrs)
            except LogError as error:
                notes.append(str(error))
            except Exception as error:
                notes.append(f"{name} cannot be read ({type(error).__name__}): it is damaged")
    return found, notes


def _attributes(given: Any) -> dict[str, Any]:
    """The attributes that matter, where they are numbers or texts. HDF5 does not survive damaged
    ones of other kinds that have no fixed length."""
    known = {key: given.get_id(key) for key in _ATTRIBUTES if key in given}
    return {
        key: _shorten(given[key])
        for key, one in known.items()
        if np.prod(one.shape, dtype=np.float64) * max(one.dtype.itemsize, 1) <= 65_536
        and (one.dtype.kind != "O" or (one.dtype.metadata or {}).get("vlen") is str)
    }


def _shorten(value: Any) -> Any:
    """An attribute; a text no longer than a unit may be."""
    return value[:200] if isinstance(value, str | bytes) else value


def _read_version_3(path: Path) -> tuple[dict[str, Variable], list[str]]:
    from scipy.io import netcdf_file

    with netcdf_file(path, "r", mmap=False) as file:
        return {
            name: (
                np.array(variable.data),
                {k: _shorten(v) for k, v in vars(variable)["_attributes"].items()},
            )
            for name, variable in file.variables.items()
            if 1 <= variable.data.ndim <= 2
        }, []


def _decode(values: NDArray[Any], attributes: Mapping[str, Any]) -> NDArray[Any]:
    """What the numbers stand for: unscaled, fill values missing, moments as datetime64."""
    if values.dtype.kind in "OS":
        return np.array([_text(value) for value in values.ravel()], dtype=object).reshape(
            values.shape
        )
    if values.dtype.kind not in "fiu":
        return values
    numbers = values.astype(values.dtype.newbyteorder("="))
    missing = [attributes[key] for key in ("_FillValue", "missing_value") if key in attributes]
    scale = float(np.ravel(attributes.get("scale_factor", 1.0))[0])
    offset = float(np.ravel(attributes.get("add_offset", 0.0))[0])
    since = _SINCE.fullmatch(_text(attributes.get("units", "")))
    if missing or since or (scale, offset) != (1.0, 0.0):
        gone = np.isin(numbers, [value for m in missing for value in np.ravel(m)])
        numbers = np.where(gone, np.nan, numbers * scale + offset)
    return _moments(numbers, since) if since and numbers.ndim == 1 else numbers


def _moments(numbers: Array, since: re.Match[str]) -> NDArray[Any]:
    """Numbers of days, hours, seconds … since a moment, as moments to the microsecond."""
    word = since["unit"].lower()
    unit_s = next((size for begins, size in _UNITS.items() if word.startswith(begins)), None)
    _, start, _ = read_clock(np.array([_clean(since["start"])], dtype=object), None)
    if start is None or unit_s is None:
        return numbers
    seconds = numbers * unit_s
    return to_moments(np.where(np.abs(seconds) < 1e11, seconds, np.nan) * 1e6, start)


def _clean(moment: str) -> str:
    """A CF reference time as ISO 8601: without the name of the zone, with two-digit parts."""
    plain = re.sub(r"\s*(UTC|GMT|Z)\s*$", "", moment.strip(), flags=re.IGNORECASE)
    return re.sub(r"(?<!\d)(\d)(?!\d)", r"0\1", plain) if "." not in plain else plain


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
