"""MATLAB files: version 5 to 7.2 with SciPy, version 7.3 with h5py, both in a child process.

Variables, and fields of structures, are named as the columns of a table are; see `columns` and
`stacked`. Recordings of the BROAD data set are known by their variables, see `broad`, and exports
of ArduPilot logs by their labels, see `ardupilot.dataflash`.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.io.matlab import MatlabFunction, MatlabOpaque, mat_struct

from agonic.errors import LogError, MissingExtraError
from agonic.logs.ardupilot.dataflash import is_labelled, read_labelled
from agonic.logs.arrays import broad
from agonic.logs.arrays.hdf5 import check_heaps, list_items, read_values
from agonic.logs.arrays.stacked import build_arrays_log, build_tables
from agonic.logs.child_process import call
from agonic.logs.headers.columns import refuse_many
from agonic.logs.log import Facts, Log
from agonic.logs.text.dialects import MAVLINK
from agonic.logs.text.kinds import build_kinds_log
from agonic.provenance import Input

VERSION_7_3 = b"MATLAB 7.3 MAT-file"
_DEEPEST = 4
_MOST_IN_A_ROW = 4  # a quaternion


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that a MATLAB file is; `unit` is that of the field where no variable names one."""
    contents = _read_contents(path)
    if is_labelled(contents):
        return read_labelled(contents, path, source)
    arrays = _flat(contents)
    if messages := _gather_messages(arrays):
        facts = Facts(path=path, source=source, format="MAVLink telemetry in MATLAB", unit=unit)
        return build_kinds_log(messages, MAVLINK, facts)
    remarks: tuple[str, ...] = ()
    if broad.is_broad(arrays):
        arrays, remarks = broad.rename_variables(arrays)
    return build_arrays_log(
        arrays, path=path, source=source, format="MATLAB file", unit=unit, remarks=remarks
    )


def read_tables(path: Path) -> list[dict[str, NDArray[Any]]]:
    """The columns that are understood, a table for each length; a lone matrix as bare axes."""
    return build_tables(_flat(_read_contents(path)))[0]


def _read_contents(path: Path) -> dict[str, Any]:
    """The variables by name: arrays, texts, structures as mappings, cells as lists."""
    with path.open("rb") as stream:
        hdf = stream.read(len(VERSION_7_3)) == VERSION_7_3
    if hdf and find_spec("h5py") is None:
        raise MissingExtraError("reading a MATLAB 7.3 file", "space")
    contents: dict[str, Any] = call(read_version_7_3 if hdf else read_version_5, path)
    return contents


def _gather_messages(arrays: Mapping[str, NDArray[Any]]) -> dict[str, dict[str, NDArray[Any]]]:
    """The columns of the MAVLink messages that Mission Planner exports: `xmag_mavlink_raw_imu_t`.

    Each is (n, 2): when it came, days as MATLAB counts them, and its value. Source: Log/MatLab.cs.
    """
    tables: dict[str, dict[str, NDArray[Any]]] = {}
    for name, array in arrays.items():
        field, _, message = name.removesuffix("_t").partition("_mavlink_")
        kind = MAVLINK.get(message.upper())
        cell = next((c for c in kind.cells if c.theirs == field), None) if kind else None
        if cell is not None and array.ndim == 2 and array.shape[1] == 2:
            table = tables.setdefault(message.upper(), {"time": array[:, 0]})
            if not cell.header.startswith("time"):  # messages count from times of their own
                table[cell.header] = array[:, 1] / cell.counts
    return tables


def read_version_5(path: Path) -> dict[str, Any]:
    """The variables of a file by name, numbers as MATLAB has them, without axes of length one.

    Objects and sparse matrices are left out. Raises `LogError` where the file is damaged; SciPy's
    reader, in C, may end the process.
    """
    try:
        found = loadmat(path, mat_dtype=True, squeeze_me=True, struct_as_record=False)
    except MemoryError:
        raise
    except Exception as error:  # damage makes it fail in many ways
        reason = " ".join(f"{error}".split())[:200] or type(error).__name__
        raise LogError(f"damaged ({reason}); fetch it again") from None
    refuse_many(len(found), "variables")
    plain = {name: _simplify(value) for name, value in found.items() if not name.startswith("__")}
    return {name: value for name, value in plain.items() if value is not None}


def _simplify(value: Any, depth: int = 0) -> Any:
    """A structure as a mapping, an array of them as one of rows, a cell array as a list; `None`
    for what is not read, or is too deep."""
    if isinstance(value, str):
        return value
    if isinstance(value, mat_struct):
        return _gather([value], depth)
    if not isinstance(value, np.ndarray | np.generic | float | int):
        return None
    array = np.asarray(value)
    if isinstance(value, MatlabFunction | MatlabOpaque) or array.dtype.kind not in "fiubO":
        return None
    if array.dtype.kind != "O":
        return array
    items = array.ravel(order="F").tolist()
    if items and all(isinstance(item, mat_struct) for item in items):
        return _gather(items, depth)
    return [_simplify(item, depth + 1) for item in items] if depth < _DEEPEST else None


def _gather(structures: list[Any], depth: int) -> dict[str, Any] | None:
    """The fields of a structure, or of several a row each."""
    if depth >= _DEEPEST:
        return None
    found: dict[str, Any] = {}
    for name in structures[0]._fieldnames:
        values = [_simplify(getattr(one, name, None), depth + 1) for one in structures]
        value = values[0] if len(values) == 1 else _stack(values)
        if value is not None:
            found[name] = value
    return found


def _stack(values: list[Any]) -> NDArray[Any] | None:
    """What a field holds in the elements of an array, a row each; a gap is NaN."""
    arrays = [np.atleast_1d(np.nan if v is None else v) for v in values]
    sizes = {a.size for a in arrays if a.dtype.kind in "fiub" and a.size}
    if len(sizes) != 1 or (size := sizes.pop()) > _MOST_IN_A_ROW:
        return None
    gap = np.full(size, np.nan)
    rows = [a.reshape(-1) if a.dtype.kind in "fiub" and a.size == size else gap for a in arrays]
    return np.squeeze(np.array(rows, dtype=np.float64))


def read_version_7_3(path: Path) -> dict[str, Any]:
    """The numeric data sets of an HDF5 file, those of a group as a dictionary."""
    import h5py

    check_heaps(path)
    with h5py.File(path, "r") as file:
        return _contents(file)


def _contents(group: Any, depth: int = 0) -> dict[str, Any]:
    """The numeric data sets of an HDF5 group; MATLAB stores them with their axes reversed."""
    contents: dict[str, Any] = {}
    for name, item in list_items(group).items():
        if hasattr(item, "items"):
            contents[name] = _contents(item, depth + 1) if depth < _DEEPEST else {}
        elif item.dtype.kind in "fiu" and item.attrs.get("MATLAB_class") != b"char":
            contents[name] = read_values(item).T
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
