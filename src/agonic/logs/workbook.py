"""Workbooks of Excel and LibreOffice, with calamine: each sheet is read as a text table is.

The sheet with a magnetometer is taken, whatever it is called; sheets of other sensors beside it are
brought to its times. Where several hold one, each is a magnetometer with the name of its sheet.
Read in a child process: a cell far out may take all memory.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import date, datetime, time, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from numpy.typing import NDArray
from python_calamine import CalamineError, CalamineWorkbook, PasswordError

from agonic.errors import LogError
from agonic.logs.contents import MOST_BYTES
from agonic.logs.folder import name_axes
from agonic.logs.groups import build_groups_log
from agonic.logs.headers.columns import identify_columns
from agonic.logs.headers.header import MOST_COLUMNS
from agonic.logs.log import Log
from agonic.logs.text import csv_text
from agonic.provenance import Input, hash_file

_MOST_SHEETS = 64
_FORMAT = "workbook"


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
    """The sheets that are not empty, each in a text file of its own; one that is listed again, or
    is the same, once."""
    found: dict[str, tuple[str, Path]] = {}
    try:
        with path.open("rb") as stream, CalamineWorkbook.from_filelike(stream) as book:
            for number, name in enumerate(book.sheet_names[:_MOST_SHEETS]):
                file = folder / f"{number}.csv"
                if _write(file, book.get_sheet_by_name(name).iter_rows()):
                    found.setdefault(hash_file(file), (name, file))
    except (CalamineError, PasswordError) as error:
        raise LogError(
            f"the workbook cannot be unpacked ({error}); open it and save the sheet as CSV"
        ) from None
    return list(found.values())


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
    """What a cell holds, as a text table would have it.

    >>> write_cell(3.0), write_cell(datetime(2026, 5, 3, 8, 15)), write_cell(timedelta(hours=12))
    ('3', '2026-05-03T08:15:00', '43200.0 s')
    """
    if isinstance(cell, bool | int):
        return str(int(cell))
    if isinstance(cell, float):
        return f"{cell:.0f}" if cell.is_integer() and abs(cell) < 1e15 else repr(cell)
    if isinstance(cell, timedelta):
        return f"{cell.total_seconds()} s"
    if isinstance(cell, datetime | date | time):
        return cell.isoformat()
    return " ".join(str(cell).split())
