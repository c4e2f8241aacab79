"""MATLAB files: version 5 to 7.2 with SciPy, version 7.3 with h5py.

Variables, and fields of structures, are named as the columns of a table are; see `columns` and
`arrays`. Recordings of the BROAD data set are known by their variables; see `broad`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.errors import MissingExtraError
from agonic.logs import broad
from agonic.logs.columns import MOST_COLUMNS, refuse_many
from agonic.logs.log import Log
from agonic.logs.stacked import build_table
from agonic.logs.table import build_log
from agonic.provenance import Input

VERSION_7_3 = b"MATLAB 7.3 MAT-file"
_HEADER_BYTES = 128
_DEEPEST = 4


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that a MATLAB file is; `unit` is that of the field where no variable names one."""
    with path.open("rb") as stream:
        hdf = stream.read(len(VERSION_7_3)) == VERSION_7_3
    arrays = _version_7_3(path) if hdf else _version_5(path)
    remarks: tuple[str, ...] = ()
    if broad.is_broad(arrays):
        arrays, remarks = broad.rename_variables(arrays)
    table, others = build_table(arrays)
    return build_log(
        table,
        path=path,
        source=source,
        format="MATLAB file",
        unit=unit,
        others=others,
        remarks=remarks,
    )


def _version_5(path: Path) -> dict[str, NDArray[Any]]:
    from scipy.io import loadmat

    refuse_many(_count_version_5(path), "variables")
    return _flat(loadmat(path, simplify_cells=True))


def _count_version_5(path: Path) -> int:
    """How many variables there are, by going from one element's tag to the next."""
    count = 0
    with path.open("rb") as stream:
        header = stream.read(_HEADER_BYTES)
        order = ">" if header.endswith(b"MI") else "<"
        while count <= MOST_COLUMNS and len(tag := stream.read(8)) == 8:
            stream.seek(int(np.frombuffer(tag, f"{order}u4")[1]), 1)
            count += 1
    return count


def _version_7_3(path: Path) -> dict[str, NDArray[Any]]:
    try:
        import h5py
    except ImportError:
        raise MissingExtraError("reading a MATLAB 7.3 file", "space") from None
    with h5py.File(path, "r") as file:
        return _flat(_contents(file))


def _contents(group: Any, depth: int = 0) -> dict[str, Any]:
    """The numeric data sets of an HDF5 group; MATLAB stores them with their axes reversed."""
    refuse_many(len(group), "variables")
    contents: dict[str, Any] = {}
    for name, item in group.items():
        if hasattr(item, "items"):
            contents[name] = _contents(item, depth + 1) if depth < _DEEPEST else {}
        elif item.dtype.kind in "fiu" and item.attrs.get("MATLAB_class") != b"char":
            contents[name] = item[()].T
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
