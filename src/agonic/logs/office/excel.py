"""The rows of the sheets of an Excel workbook (.xlsx, .xlsm), as texts.

Numbers are as they are stored; those that a style shows as moments become ISO 8601, spans of time
become seconds. Source: ECMA-376, part 1, SpreadsheetML (18.3 worksheets, 18.8.30 number formats).
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from datetime import datetime, timedelta
from typing import IO, Any, NamedTuple, NoReturn
from xml.parsers import expat
from zipfile import ZipFile

from agonic.errors import LogError
from agonic.logs.headers.header import MOST_COLUMNS
from agonic.units import DAY_S

Start = Callable[[str, Mapping[str, str]], None]
End = Callable[[str], None]
Text = Callable[[str], None]

LONGEST_TEXT = 32_767
"""Letters of a cell; a spreadsheet has no more."""
_PIECE = 1 << 16
_LONGEST_S = 60.0


def scan(stream: IO[bytes], start: Start, end: End, text: Text) -> Iterator[None]:
    """Call the handlers for elements and text, names without their prefix, a pause a piece.

    Declarations of a document type, and with them entities, are refused: no workbook has them.
    """
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartDoctypeDeclHandler = _refuse
    parser.StartElementHandler = lambda name, given: start(_plain(name), given)
    parser.EndElementHandler = lambda name: end(_plain(name))
    parser.CharacterDataHandler = text
    end_s = time.monotonic() + _LONGEST_S
    while piece := stream.read(_PIECE):
        parser.Parse(piece)
        if time.monotonic() > end_s:
            raise LogError(f"reading a sheet takes more than {_LONGEST_S:g} s; save it as CSV")
        yield
    parser.Parse(b"", True)
    yield


def _plain(name: str) -> str:
    return name.rpartition(":")[2]


def _refuse(*_: Any) -> NoReturn:
    raise LogError("its XML declares a document type, which no workbook does; save it anew")


WORKBOOK = "xl/workbook.xml"
_LITERAL = re.compile(r'"[^"]*"|\\.|\[(?!h+\]|m+\]|s+\])[^\]]*\]', re.IGNORECASE)
"""What a number format shows as it stands: quoted letters, colours, conditions."""
_BUILT_IN = {
    14: "d/m/y", 15: "d/m/y", 16: "d/m", 17: "m/y", 18: "h:m", 19: "h:m:s", 20: "h:m", 21: "h:m:s",
    22: "d/m/y h:m", 45: "m:s", 46: "[h]:m:s", 47: "m:s",
}  # fmt: skip
_MOST_SHEETS = 64
_MOST_TEXTS = 2_000_000
_MOST_DAYS = 2_958_465  # 9999-12-31


class Book(NamedTuple):
    """What the cells of all sheets share."""

    texts: list[str]
    formats: list[str]
    begin: datetime


def read_sheets(archive: ZipFile) -> Iterator[tuple[str, Iterator[list[str]]]]:
    """The name of each sheet, and its rows that are not empty."""
    if WORKBOOK not in archive.namelist():
        raise LogError("this is a document of a word processor, no workbook; save the table as CSV")
    sheets, begin = _list_sheets(archive)
    book = Book(_read_texts(archive), _read_formats(archive), begin)
    for name, part in sheets:
        yield name, _read_rows(archive, part, book)


def _list_sheets(archive: ZipFile) -> tuple[list[tuple[str, str]], datetime]:
    """The sheets with the members that hold them, and the moment from which days count."""
    parts: dict[str, str] = {}
    named: list[tuple[str, str]] = []
    begin = [datetime(1899, 12, 30)]  # Excel has a 29 February 1900

    def relation(name: str, given: Mapping[str, str]) -> None:
        if name == "Relationship":
            target = given.get("Target", "").lstrip("/")
            parts[given.get("Id", "")] = target if target.startswith("xl/") else f"xl/{target}"

    def sheet(name: str, given: Mapping[str, str]) -> None:
        if name == "sheet" and len(named) < _MOST_SHEETS:
            own = next((v for k, v in given.items() if k.endswith(":id")), "")
            named.append((given.get("name", ""), own))
        if name == "workbookPr" and given.get("date1904") in ("1", "true"):
            begin[0] = datetime(1904, 1, 1)

    _run(archive, "xl/_rels/workbook.xml.rels", relation)
    _run(archive, WORKBOOK, sheet)
    there = set(archive.namelist())
    found: dict[str, str] = {}  # a sheet that is named twice is read once
    for name, own in named:
        if (part := parts.get(own, "")) in there:
            found.setdefault(part, name)
    return [(name, part) for part, name in found.items()], begin[0]


def _run(archive: ZipFile, member: str, start: object, text: object = None) -> None:
    """Walk through a small member, if it is there."""
    if member not in archive.namelist():
        return

    def nothing(*_: object) -> None:
        return

    with archive.open(member) as stream:
        for _ in scan(stream, start, nothing, text or nothing):  # type: ignore[arg-type]
            pass


def _read_texts(archive: ZipFile) -> list[str]:
    """The texts that cells share by their numbers."""
    texts: list[str] = []

    def start(name: str, _: Mapping[str, str]) -> None:
        if name == "si":
            texts.append("")
            if len(texts) > _MOST_TEXTS:
                raise LogError("it holds more texts than a log; save the sheet as CSV")

    def text(letters: str) -> None:
        if texts:
            texts[-1] = (texts[-1] + letters)[:LONGEST_TEXT]

    _run(archive, "xl/sharedStrings.xml", start, text)
    return texts


def _read_formats(archive: ZipFile) -> list[str]:
    """The number format of each style of a cell, without what it shows as it stands."""
    codes = dict(_BUILT_IN)
    styles: list[int] = []
    inside = [False]

    def start(name: str, given: Mapping[str, str]) -> None:
        if name == "numFmt":
            code = _LITERAL.sub("", given.get("formatCode", "")).lower()
            codes[int(given.get("numFmtId", "0"))] = code if "general" not in code else ""
        elif name in ("cellXfs", "cellStyleXfs", "dxfs", "cellStyles"):
            inside[0] = name == "cellXfs"
        elif name == "xf" and inside[0]:
            styles.append(int(given.get("numFmtId", "0")))

    _run(archive, "xl/styles.xml", start)
    return [codes.get(style, "") for style in styles]


def _read_rows(archive: ZipFile, member: str, book: Book) -> Iterator[list[str]]:
    sheet = _Sheet(book)
    with archive.open(member) as stream:
        for _ in scan(stream, sheet.start, sheet.end, sheet.text):
            yield from sheet.rows
            sheet.rows.clear()


class _Sheet:
    """The cells of a sheet, put into rows as they come."""

    def __init__(self, book: Book) -> None:
        self.rows: list[list[str]] = []
        self._book = book
        self._row: list[str] = []
        self._at = 0
        self._kind = ""
        self._style = 0
        self._value: str | None = None
        self._text = ""

    def start(self, name: str, given: Mapping[str, str]) -> None:
        if name == "row":
            self._row, self._at = [], -1
        elif name == "c":
            place = given.get("r", "").rstrip("0123456789")
            self._at = _number_column(place) if place else self._at + 1
            self._kind, style = given.get("t", "n"), given.get("s", "0")
            self._style = int(style) if style.isdecimal() else 0
            self._text = ""
        elif name in ("v", "t"):
            self._value = ""

    def text(self, letters: str) -> None:
        if self._value is not None:
            self._value = (self._value + letters)[:LONGEST_TEXT]

    def end(self, name: str) -> None:
        if name in ("v", "t"):
            self._text += self._value or ""
            self._value = None
        elif name == "c" and self._text and 0 <= self._at < MOST_COLUMNS:
            self._row.extend([""] * (self._at + 1 - len(self._row)))
            self._row[self._at] = self._write()
        elif name == "row" and any(self._row):
            self.rows.append(self._row)

    def _write(self) -> str:
        """What a cell holds, as a text table would have it."""
        if self._kind == "s":
            at = int(self._text) if self._text.isdecimal() else -1
            return self._book.texts[at] if 0 <= at < len(self._book.texts) else ""
        if self._kind == "e":
            return ""  # #N/A
        formats = self._book.formats
        code = formats[self._style] if self._style < len(formats) else ""
        if self._kind != "n" or not re.search("[ymdhs]", code):
            return self._text
        with suppress(ValueError, OverflowError):
            return write_moment(float(self._text), code, self._book.begin)
        return self._text


def _number_column(letters: str) -> int:
    """The number of a column from 0: A, B, …, Z, AA.

    >>> _number_column("A"), _number_column("AB")
    (0, 27)
    """
    number = 0
    for letter in letters[:4].upper():
        number = 26 * number + ord(letter) - 64
    return number - 1


def write_moment(days: float, code: str, begin: datetime) -> str:
    """A count of days as the moment, the time of day or the span that its format shows.

    >>> begin = datetime(1899, 12, 30)
    >>> write_moment(46145.34375, "d/m/y h:m", begin), write_moment(0.34375, "h:m:s", begin)
    ('2026-05-03T08:15:00', '08:15:00')
    >>> write_moment(0.5, "[h]:m:s", begin)
    '43200.0 s'
    """
    dated = "y" in code or "d" in code
    if "[" in code or not (dated or "h" in code):
        return f"{round(days * DAY_S, 6)} s"
    if not 0 <= days < _MOST_DAYS:
        raise OverflowError("no date of Excel")
    moment = begin + timedelta(microseconds=round(days * DAY_S * 1e6))
    if days < 1 and not dated:
        return moment.time().isoformat()
    timed = "h" in code or "s" in code
    return moment.isoformat() if timed else moment.date().isoformat()
