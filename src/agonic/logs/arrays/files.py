"""Files of arrays, read in a child process: MATLAB 5 to 7.2 with SciPy, 7.3 with h5py, NumPy.

Variables, arrays, and fields of structures are named as the columns of a table are; see `columns`
and `stacked`. Recordings of the BROAD data set are known by their variables, and exports of
ArduPilot logs by their labels, see `ardupilot.dataflash`.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.errors import MissingExtraError
from agonic.logs.ardupilot.dataflash import is_labelled, read_labelled
from agonic.logs.arrays.stacked import find_tables
from agonic.logs.arrays.stored import DEEPEST, fetch, read_arrays, read_version_5, read_version_7_3
from agonic.logs.child_process import call
from agonic.logs.groups import Found, build_tables_log
from agonic.logs.log import Log
from agonic.logs.text.dialects import find_group
from agonic.provenance import Input

_VERSION_7_3 = b"MATLAB 7.3 MAT-file"
_NUMPY = {b"\x93NUMPY": "NumPy array", b"PK\x03\x04": "NumPy archive"}


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that a file is; `unit` is that of the field where no variable names one."""
    contents = None if _find_numpy(path) else _read_contents(path)
    if contents is not None and is_labelled(contents):
        return read_labelled(contents, path, source)
    return build_tables_log(read_tables(path, contents), path, source, unit)


def read_tables(path: Path, contents: Mapping[str, Any] | None = None) -> Found:
    """The columns that are understood, a table for each length; a lone matrix as bare axes.
    `contents` are those of a file of MATLAB, where they have been read."""
    if kind := _find_numpy(path):
        fields: dict[str, NDArray[Any]] = {}
        for name, array in call(read_arrays, path).items():
            parts = array.dtype.names or ()
            fields |= {part: np.asarray(array[part]) for part in parts} if parts else {name: array}
        return find_tables(fields, {"format": kind})
    arrays = _flat(_read_contents(path) if contents is None else contents)
    if messages := _gather_messages(arrays):
        corrected = {name: kind.corrected for name, kind in find_group("MAVLink").items()}
        return Found(messages, {"format": "MAVLink telemetry in MATLAB"}, corrected)
    return find_tables(arrays, {"format": "MATLAB file"})


def _find_numpy(path: Path) -> str:
    """What kind of file of NumPy it is, "" for one of MATLAB."""
    with path.open("rb") as stream:
        head = stream.read(6)
    return next((kind for mark, kind in _NUMPY.items() if head.startswith(mark)), "")


def _read_contents(path: Path) -> dict[str, Any]:
    """The variables by name: arrays, texts, structures as mappings, cells as lists."""
    with path.open("rb") as stream:
        hdf = stream.read(len(_VERSION_7_3)) == _VERSION_7_3
    if hdf and find_spec("h5py") is None:
        raise MissingExtraError("reading a MATLAB 7.3 file", "space")
    contents: dict[str, Any] = call(read_version_7_3 if hdf else read_version_5, path)
    return _fetch_all(contents) if hdf else contents


def _fetch_all(contents: Mapping[str, Any]) -> dict[str, Any]:
    """The values of groups, some from their place in the file, with the axes of MATLAB."""
    return {
        name: _fetch_all(value) if isinstance(value, Mapping) else fetch(value).T
        for name, value in contents.items()
    }


def _gather_messages(arrays: Mapping[str, NDArray[Any]]) -> dict[str, dict[str, NDArray[Any]]]:
    """The columns of the MAVLink messages that Mission Planner exports: `xmag_mavlink_raw_imu_t`.
    Each is (n, 2): when it came, days as MATLAB counts them, and its value. Source:
    Log/MatLab.cs."""
    known = find_group("MAVLink")
    tables: dict[str, dict[str, NDArray[Any]]] = {}
    for name, array in arrays.items():
        field, _, message = name.removesuffix("_t").partition("_mavlink_")
        kind = known.get(message.upper())
        cell = next((c for c in kind.cells if c.theirs == field), None) if kind else None
        if cell is not None and array.ndim == 2 and array.shape[1] == 2:
            table = tables.setdefault(message.upper(), {"time": array[:, 0]})
            if not cell.header.startswith("time"):  # messages count from times of their own
                table[cell.header] = array[:, 1] / cell.counts
    return tables


def _flat(contents: Mapping[str, Any], depth: int = 0) -> dict[str, NDArray[Any]]:
    """Variables and fields of structures by dotted name; what is not numbers or texts is left."""
    flat: dict[str, NDArray[Any]] = {}
    for name, value in contents.items():
        if isinstance(value, Mapping):
            inner = _flat(value, depth + 1) if depth < DEEPEST else {}
            flat |= {f"{name}.{key}": array for key, array in inner.items()}
        elif not name.startswith("__"):
            array = np.asarray(value)
            if array.dtype.kind in "fiub":
                flat[name] = array
    return flat
