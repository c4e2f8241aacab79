"""MATLAB files: version 5 to 7.2 behind checks of our own, version 7.3 with h5py.

SciPy's reader of version 5, in C, does not survive damaged files, which must not end a process that
reads many. Source: The MathWorks, "MAT-File Format", R2023b: tags, array flags, structures,
compression.

Variables, and fields of structures, are named as the columns of a table are; see `columns` and
`stacked`. Recordings of the BROAD data set are known by their variables, see `broad`, and exports
of ArduPilot logs by their labels, see `ardupilot.labelled`.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError, MissingExtraError
from agonic.logs.ardupilot import labelled
from agonic.logs.arrays import broad
from agonic.logs.arrays.hdf5 import Budget, check_heaps, list_items
from agonic.logs.arrays.stacked import build_arrays_log, build_tables
from agonic.logs.child_process import call
from agonic.logs.contents import MOST_BYTES
from agonic.logs.headers.columns import refuse_many
from agonic.logs.log import Log
from agonic.provenance import Input

_HEADER_BYTES = 128
_DEEPEST = 4
_MOST_IN_A_ROW = 4  # a quaternion
_MATRIX, _COMPRESSED = 14, 15
_STORED = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
    16: "u1", 17: "u2", 18: "u4",
}  # fmt: skip
"""Kinds of numbers by the type of an element."""
_CLASSES = {
    6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"
}  # fmt: skip
"""Kinds of numbers by the class of an array; what MATLAB stores may be narrower."""
_CELL, _STRUCTURE, _CHAR = 1, 2, 4
_LOGICAL = 0x200

Part = tuple[int, memoryview]
"""An element: its type and its bytes."""


def read_version_5(path: Path) -> dict[str, Any]:
    """The arrays of a file by name; those of structures in mappings of their own, cells as lists.

    Arrays have the axes that they have in MATLAB, those of length one dropped. Objects and sparse
    matrices are left out.

    Raises `LogError` where the file is damaged or holds more than memory should.
    """
    data = memoryview(path.read_bytes())
    order = ">" if bytes(data[126:128]) == b"MI" else "<"
    found: dict[str, Any] = {}
    left = MOST_BYTES
    for count, (kind, content) in enumerate(_parts(data[_HEADER_BYTES:], order), start=1):
        refuse_many(count, "variables")
        if kind == _COMPRESSED:
            content = _inflate(content, order, left)
            left -= len(content)
            kind, content = next(_parts(content, order), (0, content[:0]))
        if kind == _MATRIX:
            name, value = _matrix(content, order)
            if value is not None:
                found[name] = value
    return found


def _parts(data: memoryview, order: str) -> Iterator[Part]:
    """The elements of some bytes, one after the other."""
    at, kind_of = 0, np.dtype(f"{order}u4")
    while at + 8 <= len(data):
        first, size = (int(n) for n in np.frombuffer(data[at : at + 8], kind_of))
        if first >> 16:  # a small element: its size and its bytes stand within the tag
            kind, size, start, after = first & 0xFFFF, first >> 16, at + 4, at + 8
            if size > 4:
                raise LogError("damaged: a small element in it is too long; fetch it again")
        else:
            kind, start = first, at + 8
            after = start + (size if kind == _COMPRESSED else -(-size // 8) * 8)
        if start + size > len(data):
            raise LogError("damaged: an element in it is longer than the file; fetch it again")
        yield kind, data[start : start + size]
        at = after


def _inflate(content: memoryview, order: str, most: int) -> memoryview:
    """The element that a compressed one holds, no more than `most` bytes of it."""
    machine = zlib.decompressobj()
    try:
        tag = machine.decompress(content, 8)
        size = int(np.frombuffer(tag, f"{order}u4")[1]) if len(tag) == 8 else 0
        if size > most:
            raise LogError(
                f"its arrays take more than {MOST_BYTES / 1e9:g} GB of memory; cut it, or make it "
                "Parquet"
            )
        return memoryview(
            tag + (machine.decompress(machine.unconsumed_tail, size) if size else b"")
        )
    except zlib.error as error:
        raise LogError(f"damaged: {error}; fetch it again") from None


def _matrix(content: memoryview, order: str, depth: int = 0) -> tuple[str, Any]:
    """The name and the value of an array element; `None` where it is nothing that is read."""
    parts = _parts(content, order)
    flags = _numbers(next(parts, None), order)
    if len(flags) == 0:  # an empty field of a structure
        return "", None
    shape = tuple(int(n) for n in _numbers(next(parts, None), order))
    name = bytes(next(parts, (1, content[:0]))[1]).decode("latin-1").rstrip("\0")
    kind = int(flags[0]) & 0xFF
    if kind == _CHAR:
        return name, _text(next(parts, None), order)
    if kind == _CELL:
        return name, _cell(list(parts), order, depth)
    if kind == _STRUCTURE:
        return name, _structure(list(parts), shape, order, depth)
    if kind not in _CLASSES:
        return name, None
    values = _numbers(next(parts, None), order)
    if len(shape) < 2 or min(shape) < 0 or int(np.prod(shape, dtype=object)) != len(values):
        raise LogError(f"damaged: {name[:40]!r} does not have the size it states; fetch it again")
    stated = values.astype(bool if int(flags[0]) & _LOGICAL else _CLASSES[kind])
    return name, np.squeeze(stated.reshape(shape, order="F"))


def _text(part: Part | None, order: str) -> str:
    """The letters of a text; none where it is stored in no usual way."""
    if part is None:
        return ""
    codes = _numbers(part, order) if part[0] in _STORED else np.empty(0)
    return "".join(map(chr, codes.astype(np.int64) % 0x110000))


def _cell(parts: list[Part], order: str, depth: int) -> list[Any] | None:
    """The texts and numbers in a cell array, column by column; `None` where it is too deep."""
    if depth >= _DEEPEST:
        return None
    return [
        _matrix(content, order, depth + 1)[1] if kind == _MATRIX else None
        for kind, content in parts
    ]


def _structure(
    parts: list[Part], shape: tuple[int, ...], order: str, depth: int
) -> dict[str, Any] | None:
    """The fields of a structure, or of an array of structures a row each; `None` if too deep."""
    count = int(np.prod(shape, dtype=object))
    if len(parts) < 2 or depth >= _DEEPEST or count < 1:
        return None
    length = int(_numbers(parts[0], order)[:1].sum())
    texts = bytes(parts[1][1])
    if not 0 < length <= 256:
        raise LogError("damaged: the fields of a structure have no names; fetch it again")
    names = [texts[k : k + length].split(b"\0")[0] for k in range(0, len(texts), length)]
    refuse_many(len(names), "fields")
    found: dict[str, Any] = {}
    for at, name in enumerate(names):
        values = [
            _matrix(content, order, depth + 1)[1] if kind == _MATRIX else None
            for kind, content in parts[2 + at :: len(names)][:count]
        ]
        value = values[0] if count == 1 and values else _stack(values, count)
        if value is not None:
            found[name.decode("latin-1")] = value
    return found


def _stack(values: list[Any], count: int) -> NDArray[Any] | None:
    """What a field holds in the elements of an array, a row each; a gap is NaN."""
    arrays = [None if v is None else np.atleast_1d(v) for v in values]
    sizes = {a.size for a in arrays if a is not None and a.dtype.kind in "fiub" and a.size}
    if len(arrays) != count or len(sizes) != 1 or (size := sizes.pop()) > _MOST_IN_A_ROW:
        return None
    gap = np.full(size, np.nan)
    rows = [gap if a is None or a.size != size else a.reshape(-1) for a in arrays]
    return np.squeeze(np.array(rows, dtype=np.float64))


def _numbers(part: Part | None, order: str) -> NDArray[Any]:
    """The numbers of an element; none where it is not there or is of another kind."""
    if part is None or part[0] not in _STORED:
        return np.empty(0)
    stored = np.dtype(order + _STORED[part[0]])
    return np.frombuffer(part[1][: len(part[1]) // stored.itemsize * stored.itemsize], stored)


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
