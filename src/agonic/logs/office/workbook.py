"""Workbooks of Excel and LibreOffice: each sheet is read as a text table is.

The sheet with a magnetometer is taken, whatever it is called; sheets of other sensors beside it are
brought to its times. Where several hold one, each is a magnetometer with the name of its sheet.
"""

from __future__ import annotations

import csv
import re
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.parsers.expat import ExpatError
from zipfile import BadZipFile, ZipFile

from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.logs.contents import MOST_BYTES, check_declared
from agonic.logs.folder import name_axes
from agonic.logs.groups import build_groups_log
from agonic.logs.headers.columns import identify_columns
from agonic.logs.headers.header import MOST_COLUMNS
from agonic.logs.log import Log
from agonic.logs.office import excel
from agonic.logs.office.excel import LONGEST_TEXT, scan
from agonic.logs.text import csv_text
from agonic.provenance import Input

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
            value = _write_cell(self._cell, (self._text or "").strip())
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


def _write_cell(cell: Mapping[str, str], text: str) -> str:
    """What a cell holds, as a text table would have it.

    >>> _write_cell({"office:value-type": "time", "office:time-value": "PT08H15M30.5S"}, "8:15")
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


_MOST_SHEETS = 64
_FORMAT = "workbook"
_DAMAGE = (BadZipFile, EOFError, NotImplementedError, RuntimeError, zlib.error, ExpatError)


@dataclass(frozen=True)
class _Sheet:
    """A sheet that was understood: its text on disk, its columns, and the headers of the others."""

    name: str
    file: Path
    table: dict[str, NDArray[Any]]
    others: list[str]


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that a workbook is; `unit` is that of the field where no header names one.

    Raises `LogError` where no sheet holds a magnetometer.
    """
    with TemporaryDirectory(prefix=".agonic-") as made:
        written = _write_sheets(path, Path(made))
        sheets, said = _understand(written)
        fields = [s.name for s in sheets if "field" in identify_columns(s.table)]
        known = [s for s in sheets if identify_columns(s.table)]
        if len(known) == 1 and fields:
            log = csv_text.read(known[0].file, source, unit)
            log = replace(log, path=path, format=_FORMAT)
        else:
            log = _bring_together(sheets, path, source, unit, said)
    several = f"of {len(written)} sheets, {', '.join(map(repr, fields[:5]))} with a magnetometer"
    return replace(log, notes=(*((several,) if len(written) > 1 else ()), *log.notes))


def _bring_together(
    sheets: list[_Sheet], path: Path, source: Input, unit: str | None, said: list[str]
) -> Log:
    """The log of several sheets; one magnetometer alone is not named for its sheet."""
    if not sheets:
        raise LogError(f"no sheet in it holds a table ({'; '.join(said[:3]) or 'all are empty'})")
    alone = len(sheets) == 1
    tables: dict[Any, Any] = {s.name: name_axes(s.table, s.name, alone=alone) for s in sheets}
    fields = [name for name, table in tables.items() if "field" in identify_columns(table)]
    if len(fields) == 1:
        tables = {0 if name in fields else name: table for name, table in tables.items()}
    return build_groups_log(
        tables,
        path=path,
        source=source,
        format=_FORMAT,
        unit=unit,
        others=[header for sheet in sheets for header in sheet.others],
        paths={name: Path(name) for name in tables if name} | {"": Path(*fields[:1])},
    )


def _understand(written: list[tuple[str, Path]]) -> tuple[list[_Sheet], list[str]]:
    """The sheets that hold a table, and why the others do not."""
    sheets, said = [], []
    for name, file in written:
        try:
            table, facts = csv_text.read_table(file)
        except LogError as error:
            said.append(f"{name}: {error}")
            continue
        sheets.append(_Sheet(name, file, table, list(facts.get("others", ()))))
    return sheets, said


def _write_sheets(path: Path, folder: Path) -> list[tuple[str, Path]]:
    """The sheets that are not empty, each in a text file of its own."""
    try:
        with ZipFile(path) as archive:
            members = [member for member in archive.infolist() if member.filename.endswith(".xml")]
            check_declared(sum(m.file_size for m in members), path.stat().st_size)
            is_excel = CONTENT not in archive.namelist()
            found = excel.read_sheets(archive) if is_excel else read_sheets(archive)
            return [
                (name, file)
                for number, (name, rows) in zip(range(_MOST_SHEETS), found, strict=False)
                if _write(file := folder / f"{number}.csv", rows)
            ]
    except _DAMAGE as error:
        raise LogError(
            f"the workbook cannot be unpacked ({error}); open it and save the sheet as CSV"
        ) from None


def _write(file: Path, rows: Iterable[list[str]]) -> int:
    """Write rows as a text table; how many letters it has."""
    written = 0
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        for row in rows:
            written += writer.writerow([" ".join(cell.split()) for cell in row])
            if written > MOST_BYTES:
                raise LogError("a sheet takes more than 500 MB as text; cut it, or save Parquet")
    return written
