"""Files that hold where something stands, to go on from there: what all of them have in common."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from agonic.arrays import Array
from agonic.errors import AgonicError, LogError
from agonic.logs.contents import read_bytes

Record = TypeVar("Record")
Restored = TypeVar("Restored")

_DAMAGED = (AgonicError, ValueError, TypeError, LookupError, AttributeError, RecursionError)
"""What becomes of a file that is something else."""


def load_state(
    path: Path | str,
    kind: type[Record],
    schema: str,
    what: str,
    restore: Callable[[Record], Restored],
) -> Restored:
    """What `restore` makes of the record in a file of JSON."""
    data = read_bytes(path)
    try:
        record: Any = msgspec.json.decode(data, type=kind)
        if record.schema != schema:
            raise LogError(f'it needs "schema": "{schema}" and has {record.schema!r}')
        return restore(record)
    except _DAMAGED as error:
        raise LogError(f"not a usable {what}: {error}", path=path) from None


def as_array(kind: Any, value: Any) -> Array:
    """The numbers of an array, as a hook of `msgspec.convert`; `ValueError` where they are none."""
    array = np.array(value)
    if array.dtype.kind not in "fi":
        raise ValueError("a value is not a number")
    return array.astype(np.float64)
