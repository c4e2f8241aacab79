"""What must be checked in an HDF5 file before its library is let at it."""

from __future__ import annotations

import mmap
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.logs.contents import check_declared
from agonic.logs.headers.columns import refuse_many

_HEAP = b"GCOL"
_HEADER = 16
"""Bytes before the objects of a heap, and before the data of an object."""


def check_heaps(path: Path) -> None:
    """Raise `LogError` where a heap of texts is damaged so that HDF5 would go round for ever.

    An object of no size that stands for free space is taken up again and again by libhdf5 1.14
    (HDF5 File Format Specification 3.0, section III.E, global heap).
    """
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        start = data.find(_HEAP)
        while start >= 0:
            end = min(start + int.from_bytes(data[start + 8 : start + 16], "little"), len(data))
            at = start + _HEADER
            while at + _HEADER <= end:
                index = int.from_bytes(data[at : at + 2], "little")
                size = int.from_bytes(data[at + 8 : at + _HEADER], "little")
                step = _HEADER + -(-size // 8) * 8 if index else size
                if step == 0:
                    raise LogError("damaged: a heap in it has no end; fetch it again")
                at += step
            start = data.find(_HEAP, start + 1)


def list_items(group: Any) -> dict[str, Any]:
    """The groups and data sets that lie in an HDF5 group itself, by name.

    Links to other files, to other places in this one and around in circles are not followed.
    """
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


def read_values(item: Any) -> NDArray[Any]:
    """The values of a data set; `LogError` where they lie elsewhere or are too many."""
    if item.external or item.is_virtual:
        raise LogError(
            f"{item.name} keeps its values in another file, which is not followed; copy them "
            "into one file (h5repack)"
        )
    size = int(np.prod(item.shape, dtype=object)) * max(item.dtype.itemsize, 1)
    check_declared(size, int(item.id.get_storage_size()), str(item.name))
    return np.asarray(item[()])
