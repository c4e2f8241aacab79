"""MATLAB files: version 5 to 7.2 by `matlab_5`, version 7.3 with h5py.

Variables, and fields of structures, are named as the columns of a table are; see `columns` and
`stacked`. Recordings of the BROAD data set are known by their variables, see `broad`, and exports
of ArduPilot logs by their labels, see `ardupilot.labelled`.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.errors import MissingExtraError
from agonic.logs.ardupilot import labelled
from agonic.logs.arrays import broad
from agonic.logs.arrays.hdf5 import Budget, check_heaps, list_items
from agonic.logs.arrays.matlab_5 import read_version_5
from agonic.logs.arrays.stacked import build_arrays_log, build_tables
from agonic.logs.child_process import call
from agonic.logs.log import Log
from agonic.provenance import Input

VERSION_7_3 = b"MATLAB 7.3 MAT-file"
_DEEPEST = 4


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that a MATLAB file is; `unit` is that of the field where no variable names one."""
    with path.open("rb") as stream:
        hdf = stream.read(len(VERSION_7_3)) == VERSION_7_3
    contents = _version_7_3(path) if hdf else read_version_5(path)
    if labelled.is_labelled(contents):
        return labelled.read_labelled(contents, path, source)
    arrays = _flat(contents)
    remarks: tuple[str, ...] = ()
    if broad.is_broad(arrays):
        arrays, remarks = broad.rename_variables(arrays)
    return build_arrays_log(
        arrays, path=path, source=source, format="MATLAB file", unit=unit, remarks=remarks
    )


def read_tables(path: Path) -> list[dict[str, NDArray[Any]]]:
    """The columns that are understood, a table for each length; a lone matrix as bare axes."""
    with path.open("rb") as stream:
        hdf = stream.read(len(VERSION_7_3)) == VERSION_7_3
    return build_tables(_flat(_version_7_3(path) if hdf else read_version_5(path)))[0]


def _version_7_3(path: Path) -> dict[str, Any]:
    if find_spec("h5py") is None:
        raise MissingExtraError("reading a MATLAB 7.3 file", "space")
    contents: dict[str, Any] = call(read_version_7_3, path)
    return contents


def read_version_7_3(path: Path) -> dict[str, Any]:
    """The numeric data sets of an HDF5 file, those of a group as a dictionary."""
    import h5py

    check_heaps(path)
    with h5py.File(path, "r") as file:
        return _contents(file, Budget())


def _contents(group: Any, budget: Budget, depth: int = 0) -> dict[str, Any]:
    """The numeric data sets of an HDF5 group; MATLAB stores them with their axes reversed."""
    contents: dict[str, Any] = {}
    for name, item in list_items(group).items():
        if hasattr(item, "items"):
            contents[name] = _contents(item, budget, depth + 1) if depth < _DEEPEST else {}
        elif item.dtype.kind in "fiu" and item.attrs.get("MATLAB_class") != b"char":
            contents[name] = budget.values(item).T
    return contents


def _flat(contents: Mapping[str, Any], depth: int = 0) -> dict[str, NDArray[Any]]:
    """Variables and fields of structures by dotted name; what is not numbers or texts is left."""
    flat: dict[str, NDArray[Any]] = {}
    for name, value in contents.items():
        if isinstance(value, Mapping):
            inner = _flat(value, depth + 1) if depth < _DEEPEST else {}
            flat |= {f"{name}.{key}": array for key, array in inner.items()}
        elif not name.startswith("__"):
            array = np.asarray(value)
            if array.dtype.kind in "fiub":
                flat[name] = array
    return flat
