"""Numbers in brackets below a header, `0.1;(1.5, 2, 3)` or `0.1,(1.5),(2),(3)`, and in brackets
within brackets, as Python and NumPy print the rows of a table.

Those behind a name, as in `MAG[0]`, are a part of it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial

from agonic.errors import LogError
from agonic.logs.text.encoding import Text
from agonic.logs.text.layout import holds_values, is_header, split_cells

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
