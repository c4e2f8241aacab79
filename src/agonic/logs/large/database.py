"""Tables of Parquet files, asked by DuckDB."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from tempfile import TemporaryDirectory
from typing import Any

from agonic.errors import MissingExtraError


@contextmanager
def connect(memory_MB: int = 400, threads: int = 2) -> Iterator[Any]:
    """A DuckDB in memory, with bounds; what does not fit goes to a temporary folder."""
    try:
        import duckdb
    except ImportError:
        raise MissingExtraError("a dataset of many sensors", "fleet") from None
    with TemporaryDirectory(prefix="agonic-") as folder, duckdb.connect() as db:
        db.execute(f"set temp_directory = {quote_literal(folder)}")
        db.execute(f"set memory_limit = '{memory_MB}MB'; set threads = {threads}")
        db.execute("set preserve_insertion_order = false; set enable_progress_bar = false")
        db.execute("set TimeZone = 'UTC'")
        yield db


def select_table(files: Sequence[str]) -> str:
    """The SQL of all rows of these files, with `file_row_number` and `filename`."""
    names = ", ".join(map(quote_literal, files))
    return (
        f"read_parquet([{names}], hive_partitioning = true, hive_types_autocast = false, "
        "file_row_number = true, filename = true)"
    )


def quote(name: str) -> str:
    """A column's name in SQL.

    >>> quote('mag "x"')
    '"mag ""x""\"'
    """
    return '"' + name.replace('"', '""') + '"'


def quote_literal(text: str) -> str:
    """A text in SQL."""
    return "'" + text.replace("'", "''") + "'"


def database_error_type() -> type[Exception]:
    import duckdb

    return duckdb.Error
