"""The numbers in the rows of a text table, at the speed of a parser in C.

Clean rows go through pyarrow where it is installed and worth its import, else through NumPy; what
neither understands is read cell by cell, one block of rows at a time. A cell that is no number
becomes NaN. Registers are printed as hexadecimal digits: `0xFFB0`, or `FFB0` of a fixed width.
"""

from __future__ import annotations

import math
import operator
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.logs.contents import to_number
from agonic.logs.headers.header import is_unit
from agonic.logs.text.encoding import Text
from agonic.logs.text.layout import HEXADECIMAL, NUMBER, Layout, holds_values

_BARE = re.compile(r"[0-9a-fA-F]{4}|[0-9a-fA-F]{6}|[0-9a-fA-F]{8}")


def find_hexadecimal(rows: Sequence[Sequence[str]], columns: Mapping[int, str]) -> list[int]:
    """The columns that hold hexadecimal numbers: with 0x, or all of one width and with letters.
    `columns` are positions with what they hold: one without a letter is such too where it has the
    width of one with letters that holds the same."""
    cells = {at: [row[at] for row in rows if at < len(row) and row[at]] for at in columns}
    cells = {at: column for at, column in cells.items() if column}
    stated = {at for at, column in cells.items() if _most(map(HEXADECIMAL.fullmatch, column))}
    widths = {at: Counter(map(len, column)).most_common(1)[0][0] for at, column in cells.items()}
    bare = {
        at: (columns[at], widths[at])
        for at, column in cells.items()
        if _most(_BARE.fullmatch(cell) and len(cell) == widths[at] for cell in column)
    }
    lettered = {
        of for at, of in bare.items() if any(re.search("[a-fA-F]", cell) for cell in cells[at])
    }
    return sorted({*stated, *(at for at, of in bare.items() if of in lettered)})


def _most(found: Iterable[object]) -> bool:
    """Whether nine of ten are so, for a damaged cell."""
    fitting = [bool(one) for one in found]
    return 10 * sum(fitting) >= 9 * len(fitting)


def read_hexadecimal(cells: Sequence[str]) -> tuple[Array, str]:
    """The (n,) numbers in cells, NaN where there is none, and how they were taken. They are signed,
    as two's complement, where their steps are smaller so."""
    found = [HEXADECIMAL.fullmatch(cell) or _BARE.fullmatch(cell) for cell in cells]
    digits = [one[0].lower().removeprefix("0x") if one else "" for one in found]
    values = np.array([int(text, 16) if text else np.nan for text in digits], dtype=np.float64)
    bits = next(
        bits for bits in (8, 16, 24, 32, 64) if bits >= 4 * max(map(len, digits), default=0)
    )
    signed = np.where(values >= 2.0 ** (bits - 1), values - 2.0**bits, values)
    steps = (np.nansum(np.abs(np.diff(v[np.isfinite(v)]))) for v in (signed, values))
    if operator.lt(*steps):
        return signed, f"signed, of {bits} bits"
    return values, "unsigned"


_GROUPED = re.compile(
    r"[-+]?\d{1,3}(?:([,\u00a0\u2009\u202f'’])\d{3})(?:\1\d{3})*(?:\.\d*)?"
    r"|[-+]?\d{1,3}(?: \d{3})+\.\d+"
)
"""A number with something between its thousands; two numbers may have a plain blank between."""
_WITH_UNIT = re.compile(rf"({NUMBER})\s*([^\W\d_][\w/²^]*)")
_FORTRAN = re.compile(r"([-+]?\d*\.?\d+)[dD]([-+]?\d+)")
_BLOCK = 2_000_000
"""Bytes parsed at once."""
_LONG = 3_000_000
"""Bytes from which importing pyarrow pays."""


def read_numbers(data: Text, start: int, layout: Layout, columns: Sequence[int]) -> Array:
    """The numbers in the given columns, (k, n); NaN where there is none, surplus cells ignored. The
    rows begin at the byte `start` of the text."""
    if not columns:
        return np.empty((0, sum(1 for block in _blocks(data, start) for _ in _rows(block))))
    arrow = _import_arrow() if len(data) > _LONG and layout.separator is not None else None
    if arrow is not None:
        with np.errstate(all="ignore"):
            whole = _read_by_arrow(arrow, memoryview(data)[start:], layout, columns)
        if whole is not None:
            return whole
    blocks = []
    for block in _blocks(data, start):
        read = None if arrow is None else _read_by_arrow(arrow, block, layout, columns)
        blocks.append(_read_by_numpy(block, layout, columns) if read is None else read)
    return np.concatenate(blocks, axis=1)


def split_rows(data: Text, start: int = 0) -> list[str]:
    """The lines from a byte on that hold values."""
    return list(_rows(data[start:]))


def _rows(body: bytes) -> Iterator[str]:
    return filter(holds_values, body.decode().split("\n"))


def _blocks(data: Text, start: int) -> Iterator[bytes]:
    """Pieces of whole lines."""
    while start < len(data):
        stop = data.find(b"\n", start + _BLOCK) + 1 or len(data)
        yield data[start:stop]
        start = stop


def _import_arrow() -> Any:
    try:
        import pyarrow.csv
    except ImportError:
        return None
    return pyarrow


def read_texts(
    data: Text, start: int, layout: Layout, columns: Sequence[int]
) -> list[NDArray[np.object_]]:
    """The cells of the given columns as texts, "" where there is none."""
    arrow = _import_arrow() if len(data) > _LONG and layout.separator and not layout.comma else None
    if arrow is not None:
        body = memoryview(data)[start:]
        if (table := _parse_by_arrow(arrow, body, layout, columns, arrow.string())) is not None:
            coded = [column.combine_chunks().dictionary_encode() for column in table.columns]
            texts = [[text.strip() for text in one.dictionary.to_pylist()] for one in coded]
            return [
                np.array(words, dtype=object)[one.indices.to_numpy()]  # each is made once
                for words, one in zip(texts, coded, strict=True)
            ]
    cells = [layout.split(row) for row in split_rows(data, start)]
    return [
        np.array([row[at] if at < len(row) else "" for row in cells], dtype=object)
        for at in columns
    ]


def _parse_by_arrow(
    arrow: Any, body: bytes | memoryview, layout: Layout, columns: Sequence[int], kind: Any
) -> Any:
    """The cells of clean rows as a table of one kind; `None` where a row or a cell is not."""
    names = [str(at) for at in range(max(layout.width, len(layout.header)))]
    wanted = [names[at] for at in columns]
    try:
        return arrow.csv.read_csv(
            arrow.BufferReader(arrow.py_buffer(body)),
            read_options=arrow.csv.ReadOptions(column_names=names, block_size=_BLOCK),
            parse_options=arrow.csv.ParseOptions(delimiter=layout.separator),
            convert_options=arrow.csv.ConvertOptions(
                include_columns=wanted,
                column_types=dict.fromkeys(wanted, kind),
                decimal_point="," if layout.comma else ".",
            ),
        )
    except (arrow.ArrowInvalid, arrow.ArrowKeyError):
        return None


def _read_by_arrow(
    arrow: Any, body: bytes | memoryview, layout: Layout, columns: Sequence[int]
) -> Array | None:
    """The numbers in clean rows; `None` where a row or a cell is not."""
    table = _parse_by_arrow(arrow, body, layout, columns, arrow.float64())
    if table is None:
        return None
    values = np.empty((len(columns), table.num_rows))
    for row, column in zip(values, table.columns, strict=True):
        start = 0
        for chunk in column.chunks:
            filled = chunk.fill_null(math.nan) if chunk.null_count else chunk
            row[start : start + len(chunk)] = np.from_dlpack(filled)  # to_numpy imports pandas
            start += len(chunk)
    return values


def _read_by_numpy(body: bytes, layout: Layout, columns: Sequence[int]) -> Array:
    """The numbers in some rows, cell by cell where NumPy does not take them."""
    rows = split_rows(body)
    comma = layout.comma and layout.separator != ","
    try:
        if not rows or any('"' in row for row in rows):
            raise ValueError("quoted cells are taken apart one by one")
        plain = [row.replace(",", ".") for row in rows] if comma else rows
        return np.loadtxt(
            plain, delimiter=layout.separator, usecols=columns, comments=None, ndmin=2, unpack=True
        )
    except ValueError:
        split = map(layout.split, rows)
        cells = (
            _read_cell(row[i], layout.units.get(i, "")) if i < len(row) else math.nan
            for row in split
            for i in columns
        )
        return np.fromiter(cells, np.float64).reshape(len(rows), len(columns)).T


def _read_cell(cell: str, unit: str) -> float:
    """The number in a cell, as people and Fortran write it; a unit behind it is the column's."""
    number = to_number(cell)
    if not math.isnan(number):
        return number
    if _GROUPED.fullmatch(cell):
        return float(re.sub(r"[,\s'’]", "", cell))
    if written := _FORTRAN.fullmatch(cell):
        return to_number(f"{written[1]}e{written[2]}")
    stated = _WITH_UNIT.fullmatch(cell)
    return float(stated[1]) if unit and stated and stated[2] == unit else math.nan


def find_units(rows: Sequence[Sequence[str]], width: int) -> dict[int, str]:
    """The columns in whose cells a unit stands behind the number, and which."""
    found = {}
    for at in range(width):
        cells = [row[at] for row in rows if at < len(row) and row[at]]
        units = [match[2] if (match := _WITH_UNIT.fullmatch(cell)) else "" for cell in cells]
        unit, times = Counter(units).most_common(1)[0] if units else ("", 0)
        if 10 * times >= 9 * len(cells) and unit and is_unit(unit):
            found[at] = unit
    return found
