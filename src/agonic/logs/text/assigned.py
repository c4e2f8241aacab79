"""Arrays of numbers that source text gives names: `mag = [1 2 3; …];` of MATLAB and Octave,
`mag = np.array([[1, 2, 3], …])` of Python, `const float mag[][3] = {{1, 2, 3}, …};` of C.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

import numpy as np

from agonic.arrays import Array
from agonic.logs.headers.columns import find_columns, find_quantities
from agonic.logs.text.encoding import Text
from agonic.logs.text.layout import NUMBER

_VALUE = re.compile(rf"({NUMBER})[fF]?(?!\w)|[-+]?(?:nan|inf)\b", re.IGNORECASE)
_NAMED = re.compile(
    r"^[ \t]*(?:\w+[ \t]+)*(\w+)[ \t]*(?:\[\w*\][ \t]*)*=\s*(?:[\w.]*\()?\s*(?=[\[({])",
    re.MULTILINE,
)
_COMMENT = re.compile(r"(?://|%|#|\.\.\.).*")
_FILLING = re.compile(r"[\s,;]*")
_OPENING, _CLOSING = "[({", "])}"
_FEWEST = 4
"""Rows below which numbers in brackets are settings, no readings."""


def read_assigned(data: Text) -> dict[str, Array] | None:
    """The columns of the arrays of one length that a source text holds; `None` where none of them
    is of a magnetometer, or a name comes again and again, as in a log.

    >>> table = read_assigned(b"mag = [1 2 3\\n 4 5 6\\n 7 8 9; 1 0 1];\\nt = [0, 1, 2, 3]")
    >>> {name: column.tolist() for name, column in table.items()}["mag[0]"]
    [1.0, 4.0, 7.0, 1.0]
    """
    found = list(_find_arrays(data[:].decode("utf-8", "replace")))
    arrays = dict(found)
    lengths = Counter(len(array) for array in arrays.values() if len(array) >= _FEWEST)
    if not lengths or len(arrays) < len(found):
        return None
    rows = max(lengths, key=lambda length: (lengths[length], length))
    alike = {name: array for name, array in arrays.items() if len(array) == rows}
    table: dict[str, Array] = {}
    for name, array in alike.items():
        table |= {name: array} if array.ndim == 1 else _name_axes(name, array, len(alike) == 1)
    return table if "field" in find_quantities(table).values() else None


def _name_axes(name: str, array: Array, alone: bool) -> dict[str, Array]:
    """The columns of a matrix; a lone one of three under a name that says nothing is x, y, z."""
    names = [f"{name}[{k}]" for k in range(array.shape[1])]
    if alone and array.shape[1] == 3 and not find_columns(names):
        names = list("xyz")
    return dict(zip(names, array.T, strict=True))


def _find_arrays(text: str) -> Iterator[tuple[str, Array]]:
    """The name and the numbers, (n,) or (n, k), of each array."""
    for found in _NAMED.finditer(text):
        body = _COMMENT.sub("", _take_brackets(text, found.end()))
        array = _read_array(body)
        if array is not None:
            yield found[1], array


def _take_brackets(text: str, at: int) -> str:
    """What stands between a bracket and the one that closes it."""
    depth = 0
    for bracket in re.compile(r"[\[({\])}]").finditer(text, at):
        depth += 1 if bracket[0] in _OPENING else -1
        if depth == 0:
            return text[at + 1 : bracket.start()]
    return ""


def _read_array(body: str) -> Array | None:
    """The rows in inner brackets, or between semicolons and ends of lines, or one row."""
    nested = any(bracket in body for bracket in _OPENING)
    parts = re.split(r"[\])}]" if nested else r"[;\n]", body)
    rows = [[float(value[1] or value[0]) for value in _VALUE.finditer(part)] for part in parts]
    left = _VALUE.sub("", re.sub(r"[\[({\])}]", "", body))
    rows = [row for row in rows if row]
    if not rows or not _FILLING.fullmatch(left):
        return None
    if len(rows) == 1 or (not nested and ";" not in body and all(map(_ends, body.split("\n")))):
        return np.array([value for row in rows for value in row])
    if len({len(row) for row in rows}) > 1:
        return None
    array = np.array(rows)
    array = array.T if len(array) == 3 < array.shape[1] else array
    return array[:, 0] if array.shape[1] == 1 else array


def _ends(line: str) -> bool:
    """Whether a list goes on behind a line: it ends in a comma, or there is nothing in it."""
    return not line.strip() or line.rstrip().endswith(",")
