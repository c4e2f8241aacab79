"""The binary form of ArduPilot dataflash logs, taken apart into tables.

A message is `A3 95`, a type, and fields packed without padding; messages of type 128 (FMT) say how
long each type is and what it holds. Source: ArduPilot, libraries/AP_Logger/README.md.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from agonic.arrays import Index, Mask
from agonic.errors import LogError
from agonic.logs.log import Stream
from agonic.logs.rows.tracks import Table

Bytes = NDArray[np.uint8]

# fmt: off
DTYPES = {
    "a": "S64", "b": "i1", "B": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4",
    "q": "<i8", "Q": "<u8", "g": "<f2", "f": "<f4", "d": "<f8", "n": "S4", "N": "S16", "Z": "S64",
    "c": "<i2", "C": "<u2", "e": "<i4", "E": "<u4", "L": "<i4", "M": "u1",
}
# fmt: on
TEXTS = "anNZ"
INTEGERS = "bBhHiIqQM"
PER_UNIT = {"c": 100.0, "C": 100.0, "e": 100.0, "E": 100.0, "L": 1e7}
"""Whole numbers that count hundredths, or 1e-7 degrees."""


@dataclass(frozen=True)
class Format:
    """What an FMT message says of a type: bytes with header, a letter and a name per column."""

    name: str
    length: int
    letters: str
    columns: tuple[str, ...]

    @property
    def readable(self) -> bool:
        """Whether the letters are known and add up to the length."""
        return set(self.letters) <= set(DTYPES) and self.length == 3 + sum(
            np.dtype(DTYPES[letter]).itemsize for letter in self.letters
        )


FMT_TYPE = 128
FMT = Format("FMT", 89, "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"))


@dataclass(frozen=True, eq=False)
class Content:
    """The tables that were asked for, all message types with rates, and what was odd."""

    tables: Mapping[str, Table]
    streams: tuple[Stream, ...]
    notes: tuple[str, ...] = ()


def read_binary(path: Path, wanted: Collection[str]) -> Content:
    """The wanted messages of a `.bin` file; damaged stretches are passed over and reported."""
    data = load(path)
    size = len(data)
    marks = np.flatnonzero(data[:-2] == 0xA3)
    headers = marks[data[marks + 1] == 0x95]
    formats = _formats(data, headers)
    if not formats:
        raise LogError("no format (FMT) message found; fetch the log again", path=path)
    length = np.zeros(256, dtype=np.int64)
    for kind, fmt in formats.items():
        length[kind] = fmt.length
    starts = headers[length[data[headers + 2]] > 0]
    starts = starts[find_chained(starts, starts + length[data[starts + 2]], size)]
    skipped = size - int(length[data[starts + 2]].sum())
    notes = [f"{skipped} bytes are damaged or cut off and were skipped"] if skipped else []
    for fmt in formats.values():
        if fmt.name in wanted and not fmt.readable:
            notes.append(f"the format of {fmt.name} contradicts itself; it was not read")
    tables: dict[str, Table] = {}
    streams = []
    kinds = data[starts + 2]
    order = np.argsort(kinds, kind="stable")
    found, first = np.unique(kinds[order], return_index=True)
    for kind, rows in zip(found.tolist(), np.split(starts[order], first[1:]), strict=True):
        fmt = formats[kind]
        if fmt.readable and fmt.name in wanted and len(rows) > len(tables.get(fmt.name, ())):
            tables[fmt.name] = _table(data, rows, fmt)
        elif fmt.readable:
            clock = _table(data, rows, fmt, ("TimeUS", "TimeMS"))
            streams.append(Stream.at(fmt.name, len(clock), clock.time_s))
    streams += [Stream.at(name, len(table), table.time_s) for name, table in tables.items()]
    return Content(tables, tuple(streams), tuple(notes))


def load(path: Path) -> Bytes:
    """The bytes of a file, which stay on the disk until they are needed."""
    return np.memmap(path, np.uint8, "r") if path.stat().st_size else np.empty(0, np.uint8)


def find_chained(starts: Index, ends: Index, size: int) -> Mask:
    """Which of the places that look like a header are one, (n,). The marks also occur by chance
    within messages. A message therefore counts when it ends where another header or the file's end
    is; at the end of an unbroken chain it also counts when no header lies within it. `starts` are
    all places of the marks, `ends` where their messages would end, `size` the bytes of the file."""
    bounds = np.append(starts, size)
    following = np.searchsorted(starts, ends)
    linked = bounds[following] == ends
    overrun = bounds[1:] < ends
    keep = np.zeros(len(starts), dtype=bool)
    first, chained = 0, len(starts) > 0 and starts[0] == 0
    for k in np.flatnonzero(~linked | (following != np.arange(1, len(starts) + 1))).tolist():
        if k < first:
            continue  # marks within a message that is already taken
        keep[first:k] = True
        keep[k] = linked[k] or ((chained or k > first) and not overrun[k])
        chained = bool(linked[k])
        first = int(following[k]) if chained else k + 1
    keep[first:] = True
    return keep


def _formats(data: Bytes, headers: Index) -> dict[int, Format]:
    """The formats by type: of each, the first with another header or the file's end after it."""
    starts = headers[data[headers + 2] == FMT_TYPE]
    bounds = np.append(headers, len(data))
    ends = starts + FMT.length
    rows = starts[bounds[np.searchsorted(headers, ends)] == ends]
    if not len(rows):
        return {}
    formats = {FMT_TYPE: FMT}
    for kind, length, *texts in zip(*_table(data, rows, FMT).columns.values(), strict=True):
        name, letters, columns = (text.decode("ascii", "replace") for text in texts)
        formats.setdefault(int(kind), Format(name, int(length), letters, tuple(columns.split(","))))
    return formats


def _table(data: Bytes, starts: Index, fmt: Format, only: Collection[str] = ()) -> Table:
    """The messages at `starts`."""
    columns: dict[str, NDArray[Any]] = {}
    offset = 3
    for letter, name in zip(fmt.letters, fmt.columns, strict=False):
        dtype = np.dtype(DTYPES[letter])
        if not only or name in only:
            values = read_values(data, starts, dtype, offset)
            if letter not in TEXTS:
                with np.errstate(invalid="ignore"):  # damaged floats may be signalling NaNs
                    values = values.astype(np.float64) / PER_UNIT.get(letter, 1.0)
            columns[name] = values
        offset += dtype.itemsize
    integer = (n for n, letter in zip(fmt.columns, fmt.letters, strict=False) if letter in INTEGERS)
    return Table(starts, columns, frozenset(integer))


def read_values(data: Bytes, starts: Index, dtype: DTypeLike, offset: int) -> NDArray[Any]:
    """What stands `offset` bytes after each start, by a view that steps single bytes."""
    places = max(len(data) - offset - np.dtype(dtype).itemsize + 1, 0)
    return np.ndarray(places, dtype, data, offset if places else 0, (1,))[starts]
