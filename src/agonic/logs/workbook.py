"""Workbooks of Excel and LibreOffice, with calamine: each sheet is read as a text table is. Each
that holds a magnetometer is one; sheets of other sensors are brought to its times.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import replace
from datetime import date, datetime, time, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from python_calamine import CalamineError, CalamineWorkbook, PasswordError

from agonic.errors import LogError
from agonic.logs.contents import MOST_BYTES, MOST_PARTS
from agonic.logs.groups import build_groups_log, name_axes
from agonic.logs.headers.columns import identify_columns
from agonic.logs.headers.header import MOST_COLUMNS
from agonic.logs.log import Facts, Log, Table
from agonic.logs.text import csv_text
from agonic.provenance import Input, hash_file


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that a workbook is; `unit` is that of the field where no header names one."""
    with TemporaryDirectory(prefix=".agonic-") as made:
        written = _write_sheets(path, Path(made))
        sheets: dict[str, Table] = {}
        others: list[str] = []
        said = []
        for name, file in written.items():
            try:
                sheets[name], facts = csv_text.read_table(file)
                others += facts.get("others", ())
            except LogError as error:
                said.append(f"{name}: {error}")
        found = {name: identify_columns(table) for name, table in sheets.items()}
        fields = [name for name in found if "field" in found[name]]
        known = [name for name in found if found[name]]
        if len(known) == 1 and fields:
            log = csv_text.read(written[known[0]], source, unit)
            log = replace(log, path=path, format="workbook")
        elif not sheets:
            why = "; ".join(said[:3]) or "all are empty"
            raise LogError(f"no sheet in it holds a table ({why})")
        else:
            tables, paths = _name_tables(sheets)
            facts = Facts(path=path, source=source, format="workbook", unit=unit, others=others)
            log = build_groups_log(tables, paths, **facts)
    several = f"of {len(written)} sheets, {', '.join(map(repr, fields[:5]))} with a magnetometer"
    return replace(log, notes=(*((several,) if len(written) > 1 else ()), *log.notes))


def _name_tables(sheets: dict[str, Table]) -> tuple[dict[Any, Any], dict[str, Path]]:
    """Several sheets by their names, and those as files; one magnetometer alone has no name."""
    alone = len(sheets) == 1
    tables: dict[Any, Any] = {n: name_axes(table, n, alone=alone) for n, table in sheets.items()}
    fields = [name for name, table in tables.items() if "field" in identify_columns(table)]
    if len(fields) == 1:
        tables = {0 if name in fields else name: table for name, table in tables.items()}
    return tables, {name: Path(name) for name in tables if name} | {"": Path(*fields[:1])}


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
