"""Named arrays, as MATLAB and NumPy files hold them, made into a table.

The names are those of `columns`. A vector may be one array of three columns or three rows, and a
sampling rate may stand for the times.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.logs.columns import identify_column

SAMPLING_RATES = ("samplingrate", "samplerate", "samplingfrequency", "fs", "ratehz", "fshz")


def build_table(
    arrays: Mapping[str, NDArray[Any]],
) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """The columns that go with the magnetometer, by header, and the names of the other arrays.

    >>> table, others = build_table({"mag_uT": np.ones((3, 5)), "image": np.ones((9, 9))})
    >>> list(table), others
    (['mag_uT[0]', 'mag_uT[1]', 'mag_uT[2]'], ['image'])
    """
    columns: dict[str, NDArray[Any]] = {}
    origins: dict[str, str] = {}
    for name, array in arrays.items():
        for header, values in _columns(name, np.squeeze(array)).items():
            columns[header], origins[header] = values, name
    quantities = {h: c.quantity.column for h in columns if (c := identify_column(h)) is not None}
    rows = next((len(columns[h]) for h, name in quantities.items() if name == "field"), None)
    table = {h: columns[h] for h in quantities if len(columns[h]) == rows}
    rate = _sampling_rate(arrays)
    if rows and rate and "time" not in (quantities[h] for h in table):
        table["time_s"] = np.arange(rows) / rate
    used = {origins.get(header) for header in table}
    return table, [name for name in arrays if name not in used]


def _columns(name: str, array: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """The columns that an array holds: itself, or the three of a vector."""
    if array.ndim == 1:
        return {name: array}
    if array.ndim != 2 or 3 not in array.shape:
        return {}
    rows = array if array.shape[1] == 3 else array.T
    return {f"{name}[{k}]": rows[:, k] for k in range(3)}


def _sampling_rate(arrays: Mapping[str, NDArray[Any]]) -> float | None:
    """The positive number, Hz, that an array named as a sampling rate holds."""
    for name, array in arrays.items():
        plain = "".join(filter(str.isalpha, name)).lower()
        if plain in SAMPLING_RATES and array.size == 1 and array.dtype.kind in "fiu":
            rate = float(array.reshape(()))
            return rate if 0 < rate < np.inf else None
    return None
