"""Parquet tables, with pyarrow; columns are named as those of a text table are."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from queue import Full, Queue
from threading import Event, Thread
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError, MissingExtraError
from agonic.logs.contents import explain_damage
from agonic.logs.headers.column_names import rename_headers
from agonic.logs.headers.columns import find_columns
from agonic.logs.headers.header import name_quantity
from agonic.logs.log import About, Log
from agonic.logs.remote import Remote
from agonic.logs.text.long_table import build_tables_log
from agonic.provenance import Input

_INDEX = "__index_level_0__"
_LARGEST_FOOTER = 16_000_000
"""Bytes; 200 are a column. Far more than a log needs, and refused before it costs anything."""


_PLAIN = {"double", "float", *(f"{sign}int{8 << k}" for sign in ("", "u") for k in range(4))}
_REQUEST = 8 << 20
"""Bytes of a column that are asked of object storage at a time."""
_AHEAD = 2
"""Batches that wait, decoded."""


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that a Parquet table is; `unit` is that of the field where no column names one."""
    with explain_damage():
        table, about = read_table(path)
    return build_tables_log(table, path=path, source=source, unit=unit, **about)


def read_table(path: Path) -> tuple[dict[str, NDArray[Any]], About]:
    """The columns that are understood, by header, and what to say of the file."""
    with _open_parquet(path) as file:
        schema = file.schema
        headers = [schema.column(i).path for i in range(len(schema))]
        ours = _name_index(headers, file.schema_arrow)
        wanted = {headers[i]: name for i, name in find_columns(rename_headers(ours)).items()}
        columns = file.read(columns=list(wanted)).flatten()
    table = {
        wanted[header]: columns.column(header).to_numpy()
        for header in columns.column_names
        if header in wanted
    }
    others = [header for header in headers if header not in wanted]
    return table, {"format": "Parquet table", "others": others}


def _name_index(headers: list[str], schema: Any) -> list[str]:
    """The headers, with "time" for the nameless index of moments of a table that pandas wrote."""
    at = headers.index(_INDEX) if _INDEX in headers else -1
    if at < 0 or "timestamp" not in str(schema.field(_INDEX).type):
        return headers
    return [*headers[:at], "time", *headers[at + 1 :]] if "time" not in headers else headers


def count_rows(path: Path | Remote) -> int:
    """How many rows a Parquet table has, by its footer."""
    with _open_parquet(path) as file:
        return int(file.metadata.num_rows)


def read_batches(
    path: Path | Remote, size: int, without: tuple[str, ...] = ()
) -> Iterator[dict[str, Any]]:
    """The columns that are understood, `size` rows at a time. `without` are columns of `Samples` to
    leave out. Pages are decoded as they are needed, so that a row group as large as the file does
    no harm."""
    with _open_parquet(path) as file:
        schema = file.schema
        wanted = [
            name
            for name in find_columns([schema.column(i).path for i in range(len(schema))]).values()
            if name_quantity(name) not in without
        ]
        for batch in file.iter_batches(batch_size=size, columns=wanted, use_threads=False):
            yield _arrays(batch)


def read_ahead(
    path: Path | Remote, size: int, headers: list[str]
) -> Iterator[dict[str, NDArray[Any]]]:
    """Some columns, `size` rows at a time, decoded ahead of whoever works on them. A thread decodes
    the next few while the last are at work; nulls become NaN."""
    queue: Queue[dict[str, NDArray[Any]] | BaseException | None] = Queue(maxsize=_AHEAD)
    stopped = Event()

    def put(item: dict[str, NDArray[Any]] | BaseException | None) -> bool:
        while not stopped.is_set():
            try:
                queue.put(item, timeout=0.1)
            except Full:
                continue
            return True
        return False

    def decode() -> None:
        try:
            with _open_parquet(path) as file:
                for batch in file.iter_batches(batch_size=size, columns=headers):
                    if not put(_arrays(batch)):
                        return
            put(None)
        except BaseException as error:  # told to whoever waits for the rows
            put(error)

    reader = Thread(target=decode, daemon=True)
    reader.start()
    try:
        while (item := queue.get()) is not None:
            if isinstance(item, BaseException):
                raise item
            yield item
    finally:
        stopped.set()
        reader.join()


def _arrays(batch: Any) -> dict[str, NDArray[Any]]:
    """The columns of a record batch; nulls become NaN."""
    arrays = {}
    for name, column in zip(batch.schema.names, batch.columns, strict=True):
        plain = column.null_count == 0 and str(column.type) in _PLAIN  # spares copies, and pandas
        values = np.from_dlpack(column) if plain else column.to_numpy(zero_copy_only=False)
        arrays[name] = np.asarray(values)
    return arrays


def _open_parquet(path: Path | Remote) -> Any:
    try:
        from pyarrow.parquet import ParquetFile
    except ImportError:
        raise MissingExtraError("reading a Parquet file", "tables") from None
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(-min(8, size), 2)
        if int.from_bytes(stream.read(4), "little") > _LARGEST_FOOTER:
            raise LogError("its list of columns is too long for a log, or damaged")
    if isinstance(path, Remote):
        return ParquetFile(path.open(), pre_buffer=False, buffer_size=_REQUEST)
    return ParquetFile(path, pre_buffer=False, buffer_size=1 << 20)
