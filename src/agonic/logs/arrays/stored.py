"""What files of arrays store, read by their libraries: MATLAB, HDF5, NumPy. These crash, go round
for ever or take all memory on damaged files: whoever reads one calls them in a child process. Long
values that lie in a file as they are need no library, and are read from their place by `fetch`.
"""

from __future__ import annotations

import mmap
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.logs.contents import check_declared, explain_damage
from agonic.logs.headers.columns import refuse_many

DEEPEST = 4
"""Groups or structures within others."""
_HEAP = b"GCOL"


def check_heaps(path: Path) -> None:
    """Raise `LogError` where a heap of texts is damaged so that HDF5 would go round for ever. An
    object of no size that stands for free space is taken up again and again by libhdf5 1.14 (HDF5
    File Format Specification 3.0, section III.E, global heap)."""
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        for start in map(re.Match.start, re.finditer(_HEAP, data)):  # far faster than data.find
            end = min(start + int.from_bytes(data[start + 8 : start + 16], "little"), len(data))
            at = start + 16  # bytes before the objects of a heap, and before the data of one
            while at + 16 <= end:
                index = int.from_bytes(data[at : at + 2], "little")
                size = int.from_bytes(data[at + 8 : at + 16], "little")
                step = 16 + -(-size // 8) * 8 if index else size
                if step == 0:
                    raise LogError("damaged: a heap in it has no end; fetch it again")
                at += step


def list_items(group: Any) -> dict[str, Any]:
    """The groups and data sets that lie in an HDF5 group itself, by name. Links to other files, to
    other places in this one and around in circles are not followed."""
    import h5py

    refuse_many(len(group), "variables")
    found: dict[str, Any] = {}
    for name in group:
        if isinstance(name, bytes):
            continue  # its name is no text: it is damaged
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        item = group.get(name)
        if isinstance(item, h5py.Dataset) or (isinstance(item, h5py.Group) and item != group):
            found[name] = item
    return found


@dataclass(frozen=True)
class Place:
    """Where values lie in a file, from which byte on, of which type and shape."""

    path: str
    offset: int
    dtype: np.dtype[Any]
    shape: tuple[int, ...]


def fetch(values: NDArray[Any] | Place) -> NDArray[Any]:
    """Values, from their place where they are not here."""
    if not isinstance(values, Place):
        return values
    count = int(np.prod(values.shape))
    found = np.fromfile(values.path, values.dtype, count, offset=values.offset)
    if len(found) < count:
        raise LogError("damaged: its values end before they should; fetch it again")
    return found.reshape(values.shape)


def read_values(item: Any) -> NDArray[Any] | Place:
    """The values of a data set, or their place; `LogError` where they lie elsewhere or are too
    many."""
    if item.external or item.is_virtual:
        raise LogError(
            f"{item.name} keeps its values in another file, which is not followed; copy them "
            "into one file (h5repack)"
        )
    size = int(np.prod(item.shape, dtype=object)) * max(item.dtype.itemsize, 1)
    check_declared(size, int(item.id.get_storage_size()), str(item.name))
    plain = item.dtype.kind in "fiu" and item.chunks is None and item.id.get_offset() is not None
    if plain and item.id.get_storage_size() == size > 1_000_000:
        return Place(item.file.filename, item.id.get_offset(), item.dtype, item.shape)
    return np.asarray(item[()])


def read_version_5(path: Path) -> dict[str, Any]:
    """The variables of a file by name, numbers as MATLAB has them, without axes of length one.
    Objects and sparse matrices are left out. Raises `LogError` where the file is damaged; SciPy's
    reader, in C, may end the process."""
    from scipy.io import loadmat

    with explain_damage():
        found = loadmat(path, mat_dtype=True, squeeze_me=True, struct_as_record=False)
    refuse_many(len(found), "variables")
    plain = {name: _simplify(value) for name, value in found.items() if not name.startswith("__")}
    return {name: value for name, value in plain.items() if value is not None}


def _simplify(value: Any, depth: int = 0) -> Any:
    """A structure as a mapping, an array of them as one of rows, a cell array as a list; `None`
    for what is not read, or is too deep."""
    from scipy.io.matlab import MatlabFunction, MatlabOpaque, mat_struct

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
    return [_simplify(item, depth + 1) for item in items] if depth < DEEPEST else None


def _gather(structures: list[Any], depth: int) -> dict[str, Any] | None:
    """The fields of a structure, or of several a row each."""
    if depth >= DEEPEST:
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
    if len(sizes) != 1 or (size := sizes.pop()) > len("wxyz"):
        return None
    gap = np.full(size, np.nan)
    rows = [a.reshape(-1) if a.dtype.kind in "fiub" and a.size == size else gap for a in arrays]
    return np.squeeze(np.array(rows, dtype=np.float64))


def read_version_7_3(path: Path) -> dict[str, Any]:
    """The numeric data sets of an HDF5 file, those of a group as a dictionary."""
    import h5py

    check_heaps(path)
    with explain_damage(), h5py.File(path, "r") as file:
        return _contents(file)


def _contents(group: Any, depth: int = 0) -> dict[str, Any]:
    """The numeric data sets of an HDF5 group; their axes are in the reverse order of MATLAB."""
    contents: dict[str, Any] = {}
    for name, item in list_items(group).items():
        if hasattr(item, "items"):
            contents[name] = _contents(item, depth + 1) if depth < DEEPEST else {}
        elif item.dtype.kind in "fiu" and item.attrs.get("MATLAB_class") != b"char":
            contents[name] = read_values(item)
    return contents


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of an archive by their names, or the one of a file by its own."""
    with explain_damage("no arrays of numbers, or damaged"), path.open("rb") as stream:
        found = np.load(stream, allow_pickle=False)
        if isinstance(found, np.ndarray):
            return {path.stem: found}
        refuse_many(len(found.files), "arrays")
        arrays = {name: found[name] for name in found.files}
    if not all(isinstance(array, np.ndarray) for array in arrays.values()):  # bytes as they are
        raise LogError("no arrays of numbers, or damaged; fetch it again")
    return arrays
