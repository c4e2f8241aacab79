"""Numbers in brackets, made into plain rows; and arrays that source text gives names.

Brackets stand around rows, around cells below a header, `0.1;(1.5, 2, 3)`, and within brackets, as
Python and NumPy print the rows of a table. Those behind a name, as in `MAG[0]`, are a part of it.
Arrays are `mag = [1 2 3; …];` of MATLAB, `mag = np.array([[1, 2, 3], …])` of Python, `const float
mag[][3] = {{1, 2, 3}, …};` of C.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import zip_longest

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.contents import to_number
from agonic.logs.formats import HEAD_BYTES
from agonic.logs.headers.columns import find_columns, find_quantities
from agonic.logs.text import layout
from agonic.logs.text.encoding import Text

_NUMBER = r"[-+]?[\d.]++(?:[eE][-+]?\d++)?+"
_GROUP = re.compile(rf"(?<!\w)[(\[{{<]\s*({_NUMBER}(?:[\s,;]+{_NUMBER})*)\s*[)\]}}>]")
_BETWEEN = re.compile(r"[\s,;]+")
_PRINTED = rf"(?:{_NUMBER}|[-+]?(?:nan|inf))"
_NEST = re.compile(rf"(?:(?<=\n)|^)\s*(?:[\w.]*array\()?[(\[]\s*(?=[(\[]\s*{_PRINTED}[\s,])")
_ROW = re.compile(rf"[(\[]\s*({_PRINTED}(?:(?:\s*,\s*|\s+){_PRINTED})+),?\s*[)\]]")
_AROUND = re.compile(r"[\s,)\]]*+(?:dtype=[\w.]++\)\s*+)?")
_SEPARATORS = ";\t|,"


def unnest(data: Text) -> Text:
    """The text with a line for each innermost pair of brackets, where there is nothing else below
    an optional header."""
    text = data[:].decode("utf-8", "replace")
    nest = _NEST.search(text)
    if nest is None:
        return data
    body = text[nest.end() :]
    rows, around = _ROW.findall(body), _ROW.sub("", body)
    if around.count("...") == 1 and _AROUND.fullmatch(around.replace("...", "")):
        raise LogError(
            "NumPy printed the first and the last rows and left out those between (...); write all "
            "of them: numpy.savetxt"
        )
    if not _AROUND.fullmatch(around):
        return data
    above = [line for line in text[: nest.start()].split("\n") if line.strip()]
    between = next((one for one in _SEPARATORS if above and one in above[-1]), " ")
    return "\n".join([*above, *(_BETWEEN.sub(between, row) for row in rows)]).encode()


def open_brackets(data: Text, head: Sequence[str]) -> Text:
    """The text without brackets around numbers, where every row below a header has them. Where the
    header has a name for each number, each becomes a cell; numbers under one name become one quoted
    cell."""
    rows = [line for line in head if layout.holds_values(line)][:50]
    headed = len(rows) > 1 and not _GROUP.search(rows[0])
    if not headed or '"' in "".join(rows) or not all(map(_GROUP.search, rows[1:])):
        return data
    between = next((one for one in _SEPARATORS if one in rows[0]), None)
    names = layout.split_cells(rows[0], between)
    if not layout.is_header(names):
        return data

    def write(group: re.Match[str], *, single: bool) -> str:
        inner = _BETWEEN.sub((single and between) or " ", group[1])
        return inner if single else f'"{inner}"'

    for single in (True, False):
        opened = _GROUP.sub(partial(write, single=single), rows[1])
        if len(layout.split_cells(opened, between)) == len(names):
            first, rest = data[:].decode().split(rows[0], 1)
            return (first + rows[0] + _GROUP.sub(partial(write, single=single), rest)).encode()
    return data


_PLAIN = re.compile(r"[-+\d.eE,;\s()\[\]{}<>]+")
_STAMPED = re.compile(rf"\s*\[?({layout.STAMP})\]?\s*(?:->|>|:|,|\s)\s*(?=[-+.\d])")
"""What terminals write before a line: the moment that it came."""
_WRAPPINGS = (('"', '"'), ("/*", "*/"))
"""What stands around lines of a table: taken for single cells, or frames of Serial Studio."""
_TO_BLANKS = bytes.maketrans(b"()[]{}<>,;", b" " * 10)


def level(data: Text, head: Sequence[str]) -> Text:
    """The text with blanks for the brackets and commas of rows of mere numbers: `0 (1, 2, 3)`. Of a
    measurement of LabVIEW the table below its headers."""
    if head[0].startswith(layout.LABVIEW):
        return _read_labview(data)
    _check_groups(head)
    rows = [line for line in head if layout.holds_values(line)][:50]
    for begins, ends in _WRAPPINGS:
        if rows and all(
            row.startswith(begins) and row.rstrip().endswith(ends) and row.count(ends) < 3
            for row in rows
        ):
            return data[:].replace(begins.encode(), b"").replace(ends.encode(), b"")
    if rows and all(map(_STAMPED.match, rows)):
        return _name_stamps(data[:].decode(), rows)
    if not rows or not all(map(_PLAIN.fullmatch, rows)):
        return data
    mixed = (  # commas and blanks both stand between numbers with a decimal point
        "," in row and "." in row and any(len(cell.split()) > 1 for cell in row.split(","))
        for row in rows
    )
    return (
        data[:].translate(_TO_BLANKS)
        if any(re.search(r"[(\[{<]", row) for row in rows) or all(mixed)
        else data
    )


def _read_labview(data: Text) -> bytes:
    """The table of a measurement of LabVIEW, with the units that its header tells in its names, and
    below its rate where it has no times."""
    end = data.rfind(b"***End_of_Header***", 0, HEAD_BYTES)
    lines = data[: max(end, 0)].decode("utf-8", "replace").split("\n")
    stated = {name: cells.split("\t") for name, _, cells in (one.partition("\t") for one in lines)}
    names, _, rows = data[max(end, 0) :].partition(b"\n")[2].partition(b"\n")
    time, *channels = names.decode("utf-8", "replace").split("\t")
    columns, step = stated.get("X_Columns", ["One"])[0], to_number(stated.get("Delta_X", [""])[0])
    if columns != "Multi":
        units = stated.get("Y_Unit_Label", [])
        pairs = zip_longest(channels, units[: len(channels)], fillvalue="")
        channels = [f"{name} ({unit.strip()})" if unit.strip() else name for name, unit in pairs]
    time = "time_s" if stated.get("X_Dimension", [""])[0] == "Time" else time
    rate = f"rate: {1 / step:.12g} Hz\n" if columns == "No" and step > 0 else ""
    return (rate + "\t".join([time, *channels]) + "\n").encode() + rows


def _name_stamps(text: str, rows: Sequence[str]) -> bytes:
    """Rows with the stamp of a terminal before them; three numbers behind it are x, y and z."""
    cells = [_BETWEEN.split(_STAMPED.sub("", row, count=1).strip()) for row in rows]
    if not all(len(row) == 3 and all(re.fullmatch(_NUMBER, cell) for cell in row) for row in cells):
        return text.encode()
    lines = ["time,x,y,z"]
    for line in text.split("\n"):
        if stamp := _STAMPED.match(line):
            rest = _BETWEEN.split(line[stamp.end() :].strip())
            lines.append(",".join([stamp[1].replace(",", "."), *rest]))
    return "\n".join(lines).encode()


def _check_groups(head: Sequence[str]) -> None:
    """Raise `LogError` where lines of dashes part rows of numbers alone into groups: they may be of
    several sensors, one below the other."""
    sizes = [0]
    for line in head:
        if re.fullmatch(r"[-=_*]{3,}", line.strip()):
            sizes.append(0)
        elif line.strip():
            sizes[-1] += 1
    if len(sizes) > 3 and len({*sizes[1:-1]}) == 1 and sizes[1] > 1:
        raise LogError(
            f"lines of dashes divide its rows into groups of {sizes[1]}, each of which may be of "
            "another sensor; write one row for each moment, with names in a first line"
        )


_VALUE = re.compile(rf"({layout.NUMBER})[fF]?(?!\w)|[-+]?(?:nan|inf)\b", re.IGNORECASE)
_NAMED = re.compile(
    r"^[ \t]*(?:\w+[ \t]+)*(\w+)[ \t]*(?:\[\w*\][ \t]*)*=\s*(?:[\w.]*\()?\s*(?=[\[({])",
    re.MULTILINE,
)
_COMMENT = re.compile(r"(?://|%|#|\.\.\.).*")
_OPENING = "[({"


def read_assigned(data: Text) -> dict[str, Array] | None:
    """The columns of the arrays of one length that a source text holds; `None` where none of them
    is of a magnetometer, or a name comes again and again, as in a log."""
    found = list(_find_arrays(data[:].decode("utf-8", "replace")))
    arrays = dict(found)
    lengths = Counter(len(array) for array in arrays.values() if len(array) > 3)  # no settings
    if not lengths or len(arrays) < len(found):
        return None
    rows = max(lengths, key=lambda length: (lengths[length], length))
    table: dict[str, Array] = {}
    for name, array in arrays.items():
        if len(array) == rows and array.ndim == 1:
            table[name] = array
        elif len(array) == rows:
            names = [f"{name}[{k}]" for k in range(array.shape[1])]
            if lengths[rows] == 1 and array.shape[1] == 3 and not find_columns(names):
                names = list("xyz")  # of a lone one, whose name says nothing
            table |= dict(zip(names, array.T, strict=True))
    return table if "field" in find_quantities(table).values() else None


def _find_arrays(text: str) -> Iterator[tuple[str, Array]]:
    """The name and the numbers, (n,) or (n, k), of each array."""
    for found in _NAMED.finditer(text):
        depth = 0
        for bracket in re.compile(r"[\[({\])}]").finditer(text, found.end()):
            depth += 1 if bracket[0] in _OPENING else -1
            if depth == 0:
                body = _COMMENT.sub("", text[found.end() + 1 : bracket.start()])
                if (array := _read_array(body)) is not None:
                    yield found[1], array
                break


def _read_array(body: str) -> Array | None:
    """The rows in inner brackets, or between semicolons and ends of lines, or one row."""
    nested = not {*_OPENING}.isdisjoint(body)
    parts = re.split(r"[\])}]" if nested else r"[;\n]", body)
    rows = [[float(value[1] or value[0]) for value in _VALUE.finditer(part)] for part in parts]
    left = _VALUE.sub("", re.sub(r"[\[({\])}]", "", body))
    rows = [row for row in rows if row]
    if not rows or left.strip(" \t\r\n\f\v,;"):
        return None
    goes_on = all(not line.strip() or line.rstrip().endswith(",") for line in body.split("\n"))
    if len(rows) == 1 or (not nested and ";" not in body and goes_on):
        return np.array([value for row in rows for value in row])
    if len({len(row) for row in rows}) > 1:
        return None
    array = np.array(rows)
    array = array.T if len(array) == 3 < array.shape[1] else array
    return array[:, 0] if array.shape[1] == 1 else array
