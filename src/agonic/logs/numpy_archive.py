"""NumPy archives, `.npz`: arrays named as the columns of a table are; see `columns`, `stacked`."""

from __future__ import annotations

from pathlib import Path
from typing import IO
from zipfile import ZipFile

import numpy as np

from agonic.errors import LogError
from agonic.logs.columns import refuse_many
from agonic.logs.limits import check_declared
from agonic.logs.log import Log
from agonic.logs.stacked import build_arrays_log
from agonic.provenance import Input

_END_BYTES = 22


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that an archive is; `unit` is that of the field where no array names one."""
    refuse_many(_count(path), "arrays")
    _check_size(path)
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    return build_arrays_log(arrays, path=path, source=source, format="NumPy archive", unit=unit)


def _check_size(path: Path) -> None:
    """Raise `LogError` where the members would take more memory than they should, or state it."""
    with ZipFile(path) as archive:
        whole = sum(member.file_size for member in archive.infolist())
        for member in archive.infolist():
            with archive.open(member) as stream:
                declared = _declared_bytes(stream)
            if declared > member.file_size:
                raise LogError(f"damaged: {member.filename} is shorter than the array in it")
    check_declared(whole, path.stat().st_size)


def _declared_bytes(stream: IO[bytes]) -> int:
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
