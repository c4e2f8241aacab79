"""NumPy files, `.npz` and `.npy`: arrays named as the columns of a table are, or the file is.

The fields of a structured array are columns. See `columns`, `stacked`.
"""

from __future__ import annotations

import zlib
from pathlib import Path
from tokenize import TokenError
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.logs.arrays.stacked import build_arrays_log
from agonic.logs.child_process import call
from agonic.logs.headers.columns import refuse_many
from agonic.logs.log import Log
from agonic.provenance import Input

MAGIC = b"\x93NUMPY"
_DAMAGE = (ValueError, SyntaxError, TokenError, EOFError, OSError, BadZipFile, zlib.error)
"""What NumPy, which reads the head of an array as Python, and the archive raise of damage."""


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that an archive is; `unit` is that of the field where no array names one."""
    with path.open("rb") as stream:
        alone = stream.read(len(MAGIC)) == MAGIC
    arrays: dict[str, NDArray[Any]] = call(read_arrays, path)
    fields: dict[str, NDArray[Any]] = {}
    for name, array in arrays.items():
        parts = array.dtype.names or ()
        fields |= {part: np.asarray(array[part]) for part in parts} if parts else {name: array}
    kind = "NumPy array" if alone else "NumPy archive"
    return build_arrays_log(fields, path=path, source=source, format=kind, unit=unit)


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of an archive by their names, or the one of a file by its own.

    Raises `LogError` where there are none, or they are damaged.
    """
    try:
        with path.open("rb") as stream:
            found = np.load(stream, allow_pickle=False)
            if isinstance(found, np.ndarray):
                return {path.stem: found}
            refuse_many(len(found.files), "arrays")
            arrays = {name: found[name] for name in found.files}
    except _DAMAGE as error:
        reason = " ".join(str(error).split())[:200]
        raise LogError(f"no arrays of numbers, or damaged ({reason}); fetch it again") from None
    if not all(isinstance(array, np.ndarray) for array in arrays.values()):  # bytes as they are
        raise LogError("no arrays of numbers, or damaged; fetch it again")
    return arrays
