"""NumPy files, `.npz` and `.npy`: arrays named as the columns of a table are, or the file is.

The fields of a structured array are columns. See `columns`, `stacked`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.logs.arrays.stacked import build_arrays_log
from agonic.logs.arrays.stored import read_arrays
from agonic.logs.child_process import call
from agonic.logs.log import Log
from agonic.provenance import Input

MAGIC = b"\x93NUMPY"


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
