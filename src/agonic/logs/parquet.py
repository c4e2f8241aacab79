"""Parquet, Arrow and Feather tables, with pyarrow; columns are named as those of a text table."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError, MissingExtraError
from agonic.logs.contents import explain_damage
from agonic.logs.groups import Found
from agonic.logs.headers.column_names import rename_headers
from agonic.logs.headers.columns import find_columns
from agonic.logs.headers.header import name_quantity
from agonic.logs.log import Table
from agonic.logs.remote import Remote

_MARK = b"PAR1"
_FILE = b"ARROW1\0\0"
_INDEX = "__index_level_0__"
_LARGEST_FOOTER = 16_000_000
"""Bytes; 200 are a column. Far more than a log needs, and refused before it costs anything."""


_PLAIN = {"double", "float", *(f"{sign}int{8 << k}" for sign in ("", "u") for k in range(4))}


def read_tables(path: Path) -> Found:
    """The columns that are understood of a table, and the headers of the others."""
    with path.open("rb") as stream:
        parquet = stream.read(len(_MARK)) == _MARK
    with explain_damage():
        table, others = read_table(path) if parquet else _read_arrow(path)
    kind = "Parquet table" if parquet else "Arrow table"
    return Found({"": table}, {"format": kind, "others": others})


def read_table(path: Path) -> tuple[Table, list[str]]:
    """The columns that are understood of a Parquet table, by header, and the others."""
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
    return table, [header for header in headers if header not in wanted]


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
    the next two while the last are at work; nulls become NaN."""
    with _open_parquet(path) as file, ThreadPoolExecutor(1) as ahead:
        batches = map(_arrays, file.iter_batches(batch_size=size, columns=headers))
        waiting = deque(ahead.submit(next, batches, None) for _ in range(2))
        while (item := waiting.popleft().result()) is not None:
            waiting.append(ahead.submit(next, batches, None))
            yield item


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
        return ParquetFile(path.open(), pre_buffer=False, buffer_size=8 << 20)  # a request
    return ParquetFile(path, pre_buffer=False, buffer_size=1 << 20)


def _read_arrow(path: Path) -> tuple[Table, list[str]]:
    """The columns that are understood, and the others: those of structures by dotted names, vectors
    by [0], [1], [2]."""
    try:
        import pyarrow as pa
    except ImportError:
        raise MissingExtraError("reading an Arrow file", "tables") from None
    # no message can ask for more than there is
    with pa.BufferReader(path.read_bytes()) as file:
        batches = list(_read_batches(pa, file))
    if not batches:
        raise LogError("it holds no rows")
    table = pa.Table.from_batches(batches).flatten().flatten()
    columns: dict[str, Any] = {}
    for at, field in enumerate(table.schema):
        columns |= _take_apart(pa, field, table.column(at))
    names = list(columns)
    wanted = find_columns(rename_headers(names))
    others = [name for i, name in enumerate(names) if i not in wanted]
    return {name: columns[names[i]].to_numpy() for i, name in wanted.items()}, others


def _read_batches(pa: Any, file: Any) -> Iterator[Any]:
    """The batches of a file or a stream, whose offsets may lead anywhere: each is checked."""
    whole = file.read(len(_FILE)) == _FILE
    file.seek(0)
    reader = pa.ipc.open_file(file) if whole else pa.ipc.open_stream(file)
    numbers = range(reader.num_record_batches) if whole else count()
    for number in numbers:
        try:
            batch = reader.get_batch(number) if whole else reader.read_next_batch()
        except StopIteration:
            return
        batch.validate(full=True)
        yield batch


def _take_apart(pa: Any, field: Any, column: Any) -> dict[str, Any]:
    """A column by its name; one of lists of three as its components."""
    if pa.types.is_null(field.type):
        return {}
    if pa.types.is_fixed_size_list(field.type) and field.type.list_size == 3:
        flat = pa.chunked_array([chunk.flatten() for chunk in column.chunks], field.type.value_type)
        if len(flat) == 3 * len(column):
            values = flat.to_numpy()
            return {f"{field.name}[{k}]": pa.chunked_array([values[k::3]]) for k in range(3)}
    return {field.name: column}
