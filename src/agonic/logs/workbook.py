"""Workbooks of Excel and LibreOffice, with calamine: each sheet is read as a text table is. Each
that holds a magnetometer is one; sheets of other sensors are brought to its times.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from datetime import date, datetime, time, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from python_calamine import CalamineError, CalamineWorkbook, PasswordError

from agonic.errors import LogError
from agonic.logs.contents import MOST_BYTES, MOST_PARTS
from agonic.logs.groups import Found
from agonic.logs.headers.columns import identify_columns
from agonic.logs.headers.header import MOST_COLUMNS
from agonic.logs.log import About, Table
from agonic.logs.text import csv_text
from agonic.provenance import hash_file


def read_tables(path: Path) -> Found:
    """The columns of the sheets of a workbook that are understood; one sheet of several that holds
    a magnetometer gives its sensor no name."""
    sheets: dict[str, Table] = {}
    corrected: dict[str, str] = {}
    said = []
    others: list[str] = []
    notes: list[str] = []
    with TemporaryDirectory(prefix=".agonic-") as made:
        written = _write_sheets(path, Path(made))
        for name, file in written.items():
            try:
                found = csv_text.read_tables(file)
            except LogError as error:
                said.append(f"{name}: {error}")
                continue
            for part, table in found.tables.items():
                sheet = f"{name} {part}".rstrip()
                sheets[sheet], corrected[sheet] = table, found.corrected.get(str(part), "")
            if any(map(identify_columns, found.tables.values())) or len(written) == 1:
                others += found.about.get("others", ())
                notes += found.about.get("notes", ())
    if not sheets:
        why = "; ".join(said[:3]) or "all are empty"
        raise LogError(f"no sheet in it holds a table ({why})")
    known = {name: table for name, table in sheets.items() if identify_columns(table)}
    fields = [name for name, table in known.items() if "field" in identify_columns(table)]
    if len(written) > 1:
        where = ", ".join(map(repr, fields[:5]))
        notes.insert(0, f"of {len(written)} sheets, {where} with a magnetometer")
    alone = len(known) == 1 and bool(fields)
    of_book: About = {"format": "workbook", "others": others, "notes": tuple(notes)}
    if alone:
        return Found({"": known[fields[0]]}, of_book, {"": corrected[fields[0]]}, parts=True)
    return Found(sheets, of_book, corrected, parts=True)


def _write_sheets(path: Path, folder: Path) -> dict[str, Path]:
    """The sheets that are not empty, each in a text file of its own; one that is listed again, or
    is the same, once."""
    found: dict[str, tuple[str, Path]] = {}
    try:
        with path.open("rb") as stream, CalamineWorkbook.from_filelike(stream) as book:
            for number, name in enumerate(book.sheet_names[:MOST_PARTS]):
                file = folder / f"{number}.csv"
                if _write(file, book.get_sheet_by_name(name).iter_rows()):
                    found.setdefault(hash_file(file), (name, file))
    except (CalamineError, PasswordError) as error:
        raise LogError(
            f"the workbook cannot be unpacked ({error}); open it and save the sheet as CSV"
        ) from None
    return dict(found.values())


def _write(file: Path, rows: Iterable[list[Any]]) -> int:
    """Write the rows that are not empty as a text table; how many letters it has."""
    written = 0
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        for row in rows:
            cells = [write_cell(cell) for cell in row[:MOST_COLUMNS]]
            while cells and not cells[-1]:
                cells.pop()
            written += writer.writerow(cells) if cells else 0
            if written > MOST_BYTES:
                raise LogError("a sheet takes more than 500 MB as text; cut it, or save Parquet")
    return written


def write_cell(cell: Any) -> str:
    """What a cell holds, as a text table would have it."""
    if isinstance(cell, bool | int):
        return str(int(cell))
    if isinstance(cell, float):
        return f"{cell:.0f}" if cell.is_integer() and abs(cell) < 1e15 else repr(cell)
    if isinstance(cell, timedelta):
        return f"{cell.total_seconds()} s"
    if isinstance(cell, datetime | date | time):
        return cell.isoformat()
    return " ".join(str(cell).split())
