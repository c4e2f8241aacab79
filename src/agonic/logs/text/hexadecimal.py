"""Numbers that registers hold, as hexadecimal digits: `0xFFB0`, or `FFB0` of a fixed width."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.logs.text.layout import HEXADECIMAL

_BARE = re.compile(r"[0-9a-fA-F]{4}|[0-9a-fA-F]{6}|[0-9a-fA-F]{8}")
_LETTER = re.compile(r"[a-fA-F]")
_BITS = (8, 16, 24, 32, 64)


def find_hexadecimal(rows: Sequence[Sequence[str]], columns: Mapping[int, str]) -> list[int]:
    """The columns that hold hexadecimal numbers: with 0x, or all of one width and with letters.

    `columns` are positions with what they hold: one without a letter is such too where it has the
    width of one with letters that holds the same.

    >>> rows = [["1000", "00FF", "0012"], ["1020", "FFB0", "0013"]]
    >>> find_hexadecimal(rows, {0: "time", 1: "field", 2: "field"})
    [1, 2]
    """
    cells = {at: [row[at] for row in rows if at < len(row) and row[at]] for at in columns}
    cells = {at: column for at, column in cells.items() if column}
    stated = {at for at, column in cells.items() if _most(map(HEXADECIMAL.fullmatch, column))}
    widths = {at: Counter(map(len, column)).most_common(1)[0][0] for at, column in cells.items()}
    bare = {
        at: (columns[at], widths[at])
        for at, column in cells.items()
        if _most(_BARE.fullmatch(cell) and len(cell) == widths[at] for cell in column)
    }
    lettered = {of for at, of in bare.items() if any(map(_LETTER.search, cells[at]))}
    return sorted({*stated, *(at for at, of in bare.items() if of in lettered)})


def _most(found: Iterable[object]) -> bool:
    """Whether nine of ten are so, for a damaged cell."""
    told = [bool(one) for one in found]
    return 10 * sum(told) >= 9 * len(told)


def read_hexadecimal(cells: Sequence[str]) -> tuple[Array, str]:
    """The (n,) numbers in cells, NaN where there is none, and how they were taken.

    They are signed, as two's complement, where their steps are smaller so.

    >>> read_hexadecimal(["0x0003", "0xFFFE", "0x0001"])
    (array([ 3., -2.,  1.]), 'signed, of 16 bits')
    """
    digits = [_take_digits(cell) for cell in cells]
    values = np.array([int(text, 16) if text else np.nan for text in digits], dtype=np.float64)
    bits = next(bits for bits in _BITS if bits >= 4 * max(map(len, digits), default=0))
    signed = np.where(values >= 2.0 ** (bits - 1), values - 2.0**bits, values)
    if _measure_steps(signed) < _measure_steps(values):
        return signed, f"signed, of {bits} bits"
    return values, "unsigned"


def _take_digits(cell: str) -> str:
    if HEXADECIMAL.fullmatch(cell):
        return cell[2:]
    return cell if _BARE.fullmatch(cell) else ""


def _measure_steps(values: NDArray[np.float64]) -> float:
    """The sum of the steps from each value to the next."""
    return float(np.abs(np.diff(values[np.isfinite(values)])).sum())
