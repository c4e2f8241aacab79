"""Named arrays, as MATLAB, NumPy and HDF5 files hold them, made into tables.

The names are those of `columns`. A vector may be one array of three columns or three rows, of four
with the time first, and a sampling rate may stand for the times. Arrays of one length are a table.
Where no name is that of a magnetometer, a lone array of three columns is taken for one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from agonic.logs.groups import build_groups_log
from agonic.logs.headers.column_names import rename_headers
from agonic.logs.headers.header import identify_column, names_reading
from agonic.logs.log import Facts, Log

SAMPLING_RATES = ("samplingrate", "samplerate", "samplingfrequency", "fs", "ratehz", "fshz")

Arrays = Mapping[str, NDArray[Any]]


def build_arrays_log(arrays: Arrays, **facts: Unpack[Facts]) -> Log:
    """The log that named arrays are; the rest as for `table.build_log`."""
    tables, unused = build_tables(arrays)
    facts["others"] = [*unused, *facts.get("others", ())]
    return build_groups_log(dict(enumerate(tables)), **facts)


def build_tables(arrays: Arrays) -> tuple[list[dict[str, NDArray[Any]]], list[str]]:
    """The columns that are understood, a table for each length, and the names of other arrays.

    >>> tables, others = build_tables({"mag_uT": np.ones((3, 5)), "image": np.ones((9, 9))})
    >>> [list(table) for table in tables], others
    ([['mag_uT[0]', 'mag_uT[1]', 'mag_uT[2]']], ['image'])
    """
    found = _find_columns(arrays)
    if not any(_quantity(header) == "field" for columns in found.values() for header in columns):
        found |= _find_lone(arrays, found)
    tables: dict[int, dict[str, NDArray[Any]]] = {}
    for columns in found.values():
        for header, values in columns.items():
            tables.setdefault(len(values), {})[header] = values
    rate = _sampling_rate(arrays)
    for rows, table in tables.items():
        if rate and "time" not in map(_quantity, table):
            table["time_s"] = np.arange(rows) / rate
    ordered = sorted(tables.values(), key=lambda table: "field" not in map(_quantity, table))
    return ordered, [name for name in arrays if name not in found]


def _find_columns(arrays: Arrays) -> dict[str, dict[str, NDArray[Any]]]:
    """The columns of each array that are understood, by its name."""
    every = {name: _columns(name, np.squeeze(array)) for name, array in arrays.items()}
    headers = [header for columns in every.values() for header in columns]
    ours = dict(zip(headers, rename_headers(headers), strict=True))
    found = {}
    for name, columns in every.items():
        if known := {ours[h]: values for h, values in columns.items() if _quantity(ours[h])}:
            found[name] = known
    return found


def _quantity(header: str) -> str:
    column = identify_column(header)
    return "" if column is None else column.quantity.column


def _columns(name: str, array: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """The columns that an array holds: itself, or those of a vector, its time before them."""
    if array.ndim == 1:
        return {name: array} if len(array) > 1 else {}
    if array.ndim != 2:
        return {}
    if 3 in array.shape:
        rows = array if array.shape[1] == 3 else array.T
        return {f"{name}[{k}]": rows[:, k] for k in range(3)}
    for rows in (array, array.T):
        if rows.shape[1] in (2, 4) and len(rows) > 4 and _is_clock(rows[:, 0]):
            if rows.shape[1] == 2:
                return {f"{name}.time": rows[:, 0], name: rows[:, 1]}
            return {f"{name}.time": rows[:, 0], **_columns(name, rows[:, 1:])}
    return {}


def _is_clock(values: NDArray[Any]) -> bool:
    return values.dtype.kind in "fiu" and bool((values[1:] > values[:-1]).all())


def _find_lone(arrays: Arrays, known: Mapping[str, Any]) -> dict[str, dict[str, NDArray[Any]]]:
    """The one array of three columns, or of four with the time first, as bare x, y and z."""
    alone = {
        name: columns
        for name, array in arrays.items()
        if name not in known
        and names_reading(name)
        and array.dtype.kind in "fiu"
        and len(columns := _columns("", np.squeeze(array))) >= 3
        and len(next(iter(columns.values()))) > 4
    }
    if len(alone) != 1:
        return {}
    name, columns = next(iter(alone.items()))
    axes = {"[0]": "x", "[1]": "y", "[2]": "z", ".time": "time"}
    return {name: {axes[header]: values for header, values in columns.items()}}


def is_sampling_rate(name: str) -> bool:
    """Whether an array is named as a sampling rate in Hz.

    >>> is_sampling_rate("imu.sampling_rate"), is_sampling_rate("rate")
    (True, False)
    """
    return "".join(filter(str.isalpha, name.rpartition(".")[2])).lower() in SAMPLING_RATES


def _sampling_rate(arrays: Arrays) -> float | None:
    """The positive number, Hz, that an array named as a sampling rate holds."""
    for name, array in arrays.items():
        if is_sampling_rate(name) and array.size == 1 and array.dtype.kind in "fiu":
            rate = float(array.reshape(()))
            return rate if 0 < rate < np.inf else None
    return None
