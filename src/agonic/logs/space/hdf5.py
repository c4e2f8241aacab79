"""What must be checked in an HDF5 file before its library is let at it."""

from __future__ import annotations

import mmap
from pathlib import Path

from agonic.errors import LogError

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
