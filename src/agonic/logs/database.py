"""SQLite databases, as apps and loggers write them: each table is read as a text table is, but for
views and virtual ones, which can run code and read other files. Bare x, y and z are what their
table is named for."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.logs.child_process import LONGEST_S
from agonic.logs.contents import MOST_BYTES
from agonic.logs.groups import Found
from agonic.logs.headers.column_names import rename_headers
from agonic.logs.headers.columns import find_columns, find_quantities, identify_columns, refuse_many
from agonic.logs.log import About, Table
from agonic.logs.text.records import TEXTUAL, to_column


def read_tables(path: Path) -> Found:
    """The columns of the tables of a database that are understood."""
    try:
        with _open(path) as database:
            tables, others = _read_tables(database)
    except (sqlite3.Error, UnicodeDecodeError) as error:
        why = " ".join(str(error).split())[:160]
        raise LogError(f"the database cannot be read ({why}); copy it with its journal") from None
    waiting = Path(f"{path}-wal")
    notes = (f"rows that lie in {waiting.name} alone were not read",) * waiting.is_file()
    known = {name: table for name, table in tables.items() if identify_columns(table)}
    about: About = {"format": "SQLite database", "others": others, "notes": notes}
    if len(known) == 1:
        ((name, table),) = known.items()
        about["notes"] = (f"from its table {name!r}", *notes)
        known = {"": table}
    return Found(known, about)


@contextmanager
def _open(path: Path) -> Iterator[sqlite3.Connection]:
    """The database, read only, for a limited time."""
    address = f"file:{quote(str(path.resolve()))}?mode=ro&immutable=1"
    with closing(sqlite3.connect(address, uri=True)) as database:
        end = time.monotonic() + LONGEST_S
        database.set_progress_handler(lambda: time.monotonic() > end, 100_000)
        database.execute("PRAGMA trusted_schema = OFF")
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MOST_BYTES // 5)
        database.text_factory = lambda data: data.decode("utf-8", "replace")
        yield database


def _read_tables(database: sqlite3.Connection) -> tuple[dict[str, Table], list[str]]:
    """The columns of each table that are understood, and the headers of the others."""
    listed = database.execute(
        "SELECT name FROM sqlite_master WHERE type = 'table' AND rootpage > 0 "
        "AND name NOT LIKE 'sqlite!_%' ESCAPE '!'"
    )
    tables: dict[str, Table] = {}
    others: list[str] = []
    room = MOST_BYTES // 8
    for name in [str(row[0]) for row in listed.fetchmany(256)]:
        headers = [str(row[1]) for row in database.execute(f"PRAGMA table_info({_quote(name)})")]
        refuse_many(len(headers))
        wanted = find_columns(rename_headers(headers))
        others += [f"{name}.{header}" for i, header in enumerate(headers) if i not in wanted]
        if not wanted:
            continue
        # without what is no reading: blobs and long texts, one of which may fill memory
        chosen = ", ".join(
            f"CASE WHEN typeof({column}) IN ('integer', 'real') OR (typeof({column}) = 'text' AND "
            f"length({column}) <= 1000) THEN {column} END"
            for column in (_quote(headers[i]) for i in wanted)
        )
        rows = database.execute(f"SELECT {chosen} FROM {_quote(name)}")
        table = _read_rows(rows, list(wanted.values()), room // len(wanted))
        if table:
            tables[name] = table
            room -= sum(len(column) for column in table.values())
    return tables, others


def _quote(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'


def _read_rows(rows: sqlite3.Cursor, names: list[str], most: int) -> Table:
    """The columns of a table; nothing where it has no rows."""
    quantities = find_quantities(names)
    textual = {name: quantities[name] in TEXTUAL for name in names}
    blocks: dict[str, list[NDArray[Any]]] = {name: [] for name in names}
    count = 0
    while block := rows.fetchmany(20_000):
        count += len(block)
        if count > most:
            raise LogError("a table is too long for memory (500 MB); write it as Parquet")
        for name, values in zip(names, zip(*block, strict=True), strict=True):
            column = to_column(list(values), textual=textual[name])
            textual[name] = column.dtype.kind == "O"
            blocks[name].append(column)
    return {name: np.concatenate(parts) for name, parts in blocks.items() if parts}
