"""NumPy files, `.npz` and `.npy`: arrays named as the columns of a table are, or the file is.

The fields of a structured array are columns. See `columns`, `stacked`.
"""

from __future__ import annotations

import zlib
from pathlib import Path
from tokenize import TokenError
from typing import IO, Any
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.logs.arrays.stacked import build_arrays_log
from agonic.logs.contents import check_declared
from agonic.logs.headers.columns import refuse_many
from agonic.logs.log import Log
from agonic.provenance import Input

MAGIC = b"\x93NUMPY"
_END_BYTES = 22
_DAMAGE = (ValueError, SyntaxError, TokenError, EOFError, OSError, BadZipFile, zlib.error)
"""What NumPy, which reads the head of an array as Python, and the archive raise of damage."""


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that an archive is; `unit` is that of the field where no array names one."""
    with path.open("rb") as stream:
        alone = stream.read(len(MAGIC)) == MAGIC
    try:
        arrays = {path.stem: _read_array(path)} if alone else _read_archive(path)
    except _DAMAGE as error:
        reason = " ".join(str(error).split())[:200]
        raise LogError(f"no arrays of numbers, or damaged ({reason}); fetch it again") from None
    fields: dict[str, NDArray[Any]] = {}
    for name, array in arrays.items():
        parts = array.dtype.names or ()
        fields |= {part: np.asarray(array[part]) for part in parts} if parts else {name: array}
    kind = "NumPy array" if alone else "NumPy archive"
    return build_arrays_log(fields, path=path, source=source, format=kind, unit=unit)


def _read_array(path: Path) -> NDArray[Any]:
    """The one array of a file."""
    with path.open("rb") as stream:
        declared, size = _read_declared_bytes(stream), path.stat().st_size
        if declared > size - stream.tell():
            raise LogError("damaged: the file is shorter than the array in it; fetch it again")
        check_declared(declared, size)
        stream.seek(0)
        return np.asarray(np.load(stream, allow_pickle=False))


def _read_archive(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of an archive by their names."""
    refuse_many(_count(path), "arrays")
    _check_size(path)
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    if not all(isinstance(array, np.ndarray) for array in arrays.values()):
        raise ValueError("a member is no array")  # NumPy hands such bytes out as they are
    return arrays


def _check_size(path: Path) -> None:
    """Raise `LogError` where the members would take more memory than they should, or state it."""
    with ZipFile(path) as archive:
        whole = sum(member.file_size for member in archive.infolist())
        for member in archive.infolist():
            with archive.open(member) as stream:
                declared = _read_declared_bytes(stream)
            if declared > member.file_size:
                raise LogError(f"damaged: {member.filename} is shorter than the array in it")
    check_declared(whole, path.stat().st_size)


def _read_declared_bytes(stream: IO[bytes]) -> int:
    """How many bytes the head of an array says its values have; 0 where it has none."""
    try:
        version = np.lib.format.read_magic(stream)
        read = (
            np.lib.format.read_array_header_1_0
            if version == (1, 0)
            else np.lib.format.read_array_header_2_0
        )
        shape, _, kind = read(stream)
    except ValueError:
        return 0
    return int(np.prod(shape, dtype=object)) * kind.itemsize


def _count(path: Path) -> int:
    """How many files the end record of the archive says there are, without reading the list."""
    with path.open("rb") as stream:
        stream.seek(-min(_END_BYTES, path.stat().st_size), 2)
        return int.from_bytes(stream.read()[10:12], "little")
