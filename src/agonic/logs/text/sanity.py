"""What a text table may hide: brackets around rows, another header, cells without numbers.

Brackets stand around rows, around cells below a header, `0.1;(1.5, 2, 3)` or `0.1,(1.5),(2),(3)`,
and within brackets, as Python and NumPy print the rows of a table. Those behind a name, as in
`MAG[0]`, are a part of it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.logs.contents import to_number
from agonic.logs.headers.columns import find_quantities, identify_columns
from agonic.logs.headers.conventions import find_named_quantity
from agonic.logs.headers.quantities import FALLBACK
from agonic.logs.text.encoding import Text
from agonic.logs.text.layout import (
    LABVIEW,
    STAMP,
    Layout,
    Table,
    holds_values,
    is_header,
    split_cells,
)
from agonic.logs.text.numbers import split_rows

_NUMBER = r"[-+]?[\d.]++(?:[eE][-+]?\d++)?+"
_GROUP = re.compile(rf"(?<!\w)[(\[{{<]\s*({_NUMBER}(?:[\s,;]+{_NUMBER})*)\s*[)\]}}>]")
_BETWEEN = re.compile(r"[\s,;]+")
_PRINTED = rf"(?:{_NUMBER}|[-+]?(?:nan|inf))"
_NEST = re.compile(rf"(?:(?<=\n)|^)\s*(?:[\w.]*array\()?[(\[]\s*(?=[(\[]\s*{_PRINTED}[\s,])")
_ROW = re.compile(rf"[(\[]\s*({_PRINTED}(?:(?:\s*,\s*|\s+){_PRINTED})+),?\s*[)\]]")
_AROUND = re.compile(r"[\s,)\]]*+(?:dtype=[\w.]++\)\s*+)?")
_SEPARATORS = ";\t|,"
_LOOKED_AT = 50
"""Rows that tell of all."""


def unnest(data: Text) -> Text:
    """The text with a line for each innermost pair of brackets, where there is nothing else below
    an optional header.

    Raises `LogError` where NumPy has left out rows.

    >>> unnest(b"[[1. 2.\\n  3.]\\n [4. 5.\\n  6.]]")
    b'1. 2. 3.\\n4. 5. 6.'
    """
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
    """The text without brackets around numbers, where every row below a header has them.

    Where the header has a name for each number, each becomes a cell; numbers under one name become
    one quoted cell.

    >>> rows = ["time_s,mag_uT", "0.1,(1.5, 2, 3)"]
    >>> open_brackets("\\n".join(rows).encode(), rows).decode().split("\\n")
    ['time_s,mag_uT', '0.1,"1.5 2 3"']
    """
    rows = [line for line in head if holds_values(line)][:_LOOKED_AT]
    headed = len(rows) > 1 and not _GROUP.search(rows[0])
    if not headed or '"' in "".join(rows) or not all(map(_GROUP.search, rows[1:])):
        return data
    between = next((one for one in _SEPARATORS if one in rows[0]), None)
    names = split_cells(rows[0], between)
    if not is_header(names):
        return data
    apart = _GROUP.sub(partial(_open, between=between), rows[1])
    single = len(split_cells(apart, between)) == len(names)
    if not single and len(split_cells(_GROUP.sub(_quote, rows[1]), between)) != len(names):
        return data
    write = partial(_open, between=between) if single else _quote
    first, rest = data[:].decode().split(rows[0], 1)
    return (first + rows[0] + _GROUP.sub(write, rest)).encode()


def _open(group: re.Match[str], between: str | None) -> str:
    """Each number as a cell."""
    return _BETWEEN.sub(between or " ", group[1])


def _quote(group: re.Match[str]) -> str:
    """All numbers as one cell."""
    return '"' + _BETWEEN.sub(" ", group[1]) + '"'


_PLAIN = re.compile(r"[-+\d.eE,;\s()\[\]{}<>]+")
_STAMPED = re.compile(rf"\s*\[?({STAMP})\]?\s*(?:->|>|:|,|\s)\s*(?=[-+.\d])")
"""What terminals write before a line: the moment that it came."""
_ONE_NUMBER = re.compile(r"[-+]?[\d.]+(?:[eE][-+]?\d+)?")
_BRACKET = re.compile(r"[(\[{<]")
_TO_BLANKS = bytes.maketrans(b"()[]{}<>,;", b" " * 10)
_LABVIEW_END = b"***End_of_Header***"
_TIMED = re.compile(rb"X_Dimension\tTime")
_HEAD = 20_000
_RULE = re.compile(r"[-=_*]{3,}")
_FEW_GROUPS = 3
_NOTHING = ("", "nan", "null", "none", "na", "n/a", "#n/a", "inf", "-inf", "-")


def level(data: Text, head: Sequence[str]) -> Text:
    """The text with blanks for the brackets and commas of rows of mere numbers: `0 (1, 2, 3)`.

    Of a measurement of LabVIEW the table below its headers.

    >>> level(b"(1, 2, 3)", ["(1, 2, 3)"]).split()
    [b'1', b'2', b'3']
    """
    if head[0].startswith(LABVIEW):
        body = data[data.rfind(_LABVIEW_END, 0, _HEAD) :].partition(b"\n")[2]
        return body.replace(b"X_Value", b"time_s", 1) if _TIMED.search(data[:_HEAD]) else body
    check_groups(head)
    rows = [line for line in head if holds_values(line)][:50]
    if rows and all(
        row.count('"') == 2 and row.strip()[:: len(row.strip()) - 1] == '""' for row in rows
    ):
        return data[:].replace(b'"', b"")  # a table whose lines were taken for single cells
    if rows and all(map(_STAMPED.match, rows)):
        return _name_stamps(data[:].decode(), rows)
    plain = bool(rows) and all(map(_PLAIN.fullmatch, rows))
    if not plain or not (any(map(_BRACKET.search, rows)) or all(map(_is_mixed, rows))):
        return data
    return data[:].translate(_TO_BLANKS)


def _name_stamps(text: str, rows: Sequence[str]) -> bytes:
    """Rows with the stamp of a terminal before them; three numbers behind it are x, y and z."""
    cells = [re.split(r"[\s,;]+", _STAMPED.sub("", row, count=1).strip()) for row in rows]
    if not all(len(row) == 3 and all(map(_ONE_NUMBER.fullmatch, row)) for row in cells):
        return text.encode()
    lines = ["time,x,y,z"]
    for line in text.split("\n"):
        if stamp := _STAMPED.match(line):
            rest = re.split(r"[\s,;]+", line[stamp.end() :].strip())
            lines.append(",".join([stamp[1].replace(",", "."), *rest]))
    return "\n".join(lines).encode()


def _is_mixed(row: str) -> bool:
    """Whether commas and blanks both stand between numbers with a decimal point."""
    cells = [cell.split() for cell in row.split(",")]
    return len(cells) > 1 and any(len(cell) > 1 for cell in cells) and "." in row


def cut_at_header(
    table: Table, data: Text, start: int, layout: Layout
) -> tuple[Table, tuple[str, ...]]:
    """The columns as far as the header holds for their rows, and a note where another follows."""
    numbers = [values for values in table.values() if values.dtype.kind == "f"]
    if not numbers:
        return table, ()
    empty = np.flatnonzero(np.isnan(numbers).all(axis=0))
    if not len(empty):
        return table, ()
    rows = split_rows(data, start)
    for at in empty[empty < len(rows)]:
        cells = layout.split(rows[at])
        if _is_other_header(cells, layout.header):
            left = len(rows) - int(at) - 1
            if not at:
                break
            note = f"another header follows after row {at}: the {left} rows below it were not read"
            return {name: values[:at] for name, values in table.items()}, (note,)
    return table, ()


def _is_other_header(cells: Sequence[str], header: Sequence[str]) -> bool:
    """Whether cells name columns, and others than the header does."""
    if not is_header(cells) or len([q for q in find_quantities(cells).values() if q]) < 2:
        return False
    pairs = list(zip(cells, header, strict=False))
    return len(cells) != len(header) or not all(h.startswith(cell) for cell, h in pairs)


def check_numbers(table: Table, data: Text, start: int, layout: Layout) -> None:
    """Raise `LogError` where no row has all axes of a magnetometer and cells are no numbers."""
    fields = identify_columns(table).get("field", {})
    for axes in fields.values():
        values = [table[axis.header] for axis in axes.values()]
        if np.isfinite(values).all(axis=0).any():
            return
    rows = [split_cells(row, layout.separator) for row in split_rows(data[: start + _HEAD], start)]
    for name in (axis.header for axes in fields.values() for axis in axes.values()):
        at = layout.header.index(name) if name in layout.header else 0
        for cell in (row[at] for row in rows[:-1] if at < len(row)):
            if cell.lower() not in _NOTHING and math.isnan(to_number(cell)):
                raise LogError(
                    f"the cells of {name!r} hold no number that can be read, such as "
                    f"{cell[:30]!r}; write 12.5, with the unit in the header"
                )


def check_groups(head: Sequence[str]) -> None:
    """Raise `LogError` where lines of dashes part rows of numbers alone into groups: they may be of
    several sensors, one below the other.
    """
    sizes = [0]
    for line in head:
        if _RULE.fullmatch(line.strip()):
            sizes.append(0)
        elif line.strip():
            sizes[-1] += 1
    if len(sizes) > _FEW_GROUPS and len({*sizes[1:-1]}) == 1 and sizes[1] > 1:
        raise LogError(
            f"lines of dashes divide its rows into groups of {sizes[1]}, each of which may be of "
            "another sensor; write one row for each moment, with names in a first line"
        )


def check_title(table: Mapping[str, NDArray[Any]], lines: Sequence[str]) -> None:
    """Raise `LogError` where x, y and z stand alone and the lines above name another sensor."""
    axes = identify_columns(table).get("field", {}).get("", {})
    if not axes or any(column.rank != FALLBACK for column in axes.values()):
        return
    named = [find_named_quantity(line[:200]) for line in lines[:50]]
    if "field" not in named and any(name in ("acceleration", "rotation_rate") for name in named):
        line = next(line for line, name in zip(lines, named, strict=False) if name)
        raise LogError(
            f"its x, y and z are of no magnetometer, by the line {line.strip()[:60]!r} above them; "
            "name the file of the magnetometer"
        )
