"""The rows of the sheets of an OpenDocument spreadsheet (.ods), as texts.

Source: OASIS, Open Document Format 1.3, part 3, 9.1 tables and 19.385 office:value-type.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import groupby
from operator import itemgetter
from zipfile import ZipFile

from agonic.logs.headers.header import MOST_COLUMNS
from agonic.logs.office.scan import LONGEST_TEXT, scan

CONTENT = "content.xml"
_SPAN = re.compile(r"-?PT(?:(\d+)H)?(?:(\d+)M)?(?:(\d+(?:[.,]\d+)?)S)?")
_MOST_REPEATED = 10_000
"""Rows that one stands for; what is repeated to the end of a sheet is empty."""


def read_sheets(archive: ZipFile) -> Iterator[tuple[str, Iterator[list[str]]]]:
    """The name of each sheet, and its rows that are not empty."""
    for name, rows in groupby(_read_rows(archive), key=itemgetter(0)):
        yield name, (row for _, row in rows)


def _read_rows(archive: ZipFile) -> Iterator[tuple[str, list[str]]]:
    document = _Document()
    with archive.open(CONTENT) as stream:
        for _ in scan(stream, document.start, document.end, document.text):
            yield from document.rows
            document.rows.clear()


class _Document:
    """The cells of the sheets, put into rows as they come."""

    def __init__(self) -> None:
        self.rows: list[tuple[str, list[str]]] = []
        self._sheet = ""
        self._row: list[str] = []
        self._times = 1
        self._cell: Mapping[str, str] = {}
        self._text: str | None = None

    def start(self, name: str, given: Mapping[str, str]) -> None:
        if name == "table":
            self._sheet = given.get("table:name", "")
        elif name == "table-row":
            self._row, self._times = [], _count(given, "rows")
        elif name in ("table-cell", "covered-table-cell"):
            self._cell, self._text = given, ""

    def text(self, letters: str) -> None:
        if self._text is not None:
            self._text = (self._text + letters)[:LONGEST_TEXT]

    def end(self, name: str) -> None:
        if name in ("table-cell", "covered-table-cell"):
            value = _write(self._cell, (self._text or "").strip())
            times = min(_count(self._cell, "columns"), MOST_COLUMNS - len(self._row))
            self._row += [value] * max(times, 0)
            self._text = None
        elif name == "table-row" and any(self._row):
            while self._row[-1] == "":
                self._row.pop()
            self.rows += [(self._sheet, self._row)] * min(self._times, _MOST_REPEATED)


def _count(given: Mapping[str, str], what: str) -> int:
    """How often a row or a cell is repeated."""
    times = given.get(f"table:number-{what}-repeated", "1")
    return int(times) if times.isdecimal() and len(times) < 9 else 1


def _write(cell: Mapping[str, str], text: str) -> str:
    """What a cell holds, as a text table would have it.

    >>> _write({"office:value-type": "time", "office:time-value": "PT08H15M30.5S"}, "8:15")
    '08:15:30.5'
    """
    kind = cell.get("office:value-type", "")
    if kind in ("float", "percentage", "currency"):
        return cell.get("office:value", text)
    if kind == "date":
        return cell.get("office:date-value", text)
    if kind == "time" and (span := _SPAN.fullmatch(cell.get("office:time-value", ""))):
        hours, minutes, seconds = (part or "0" for part in span.groups())
        return f"{int(hours):02}:{int(minutes):02}:{seconds.replace(',', '.'):0>2}"
    return text
