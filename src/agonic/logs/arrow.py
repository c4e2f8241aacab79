"""Arrow and Feather files and streams, with pyarrow; columns are named as those of a table are.

The library makes room for what a packed buffer declares, and a file of a megabyte may declare all
the memory there is: what buffers unpack to is counted before. Source: Apache Arrow, Message.fbs;
FlatBuffers, internals: a table begins with the distance back to the places of its fields.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from agonic.errors import LogError, MissingExtraError
from agonic.logs.contents import check_declared
from agonic.logs.headers.column_names import rename_headers
from agonic.logs.headers.columns import find_columns
from agonic.logs.log import Log
from agonic.logs.text.long_table import build_tables_log
from agonic.provenance import Input

_DICTIONARY, _BATCH = 2, 3
_KIND, _HEADER = 1, 2
_DATA = 1
_BUFFERS, _COMPRESSION = 2, 3
_BUFFER = struct.Struct("<qq")


def count_unpacked_bytes(pa: Any, source: Any) -> int:
    """The bytes that all packed buffers of a stream of messages declare; 0 where none is packed.

    Parameters: `pa`, the module pyarrow; `source`, a file of it at the first message.

    Raises `LogError` where a message is not what it states.
    """
    try:
        return sum(_count(message) for message in _messages(pa, source))
    except (struct.error, IndexError, pa.ArrowException) as error:
        raise LogError(f"damaged: a message in it is not whole ({error}); fetch it again") from None


def _messages(pa: Any, source: Any) -> Iterator[Any]:
    """The messages up to the mark that ends them; what is behind it, a footer, is none."""
    reader = pa.ipc.MessageReader.open_stream(source)
    while True:
        try:
            yield reader.read_next_message()
        except (StopIteration, EOFError):
            return


def _count(message: Any) -> int:
    """The bytes that the packed buffers of one message declare."""
    data = bytes(message.metadata)
    root = _follow(data, 0)
    kind = data[at] if (at := _field(data, root, _KIND)) else 0
    if kind not in (_DICTIONARY, _BATCH):
        return 0
    batch = _follow(data, _field(data, root, _HEADER))
    if kind == _DICTIONARY:
        batch = _follow(data, _field(data, batch, _DATA))
    if not _field(data, batch, _COMPRESSION) or not (at := _field(data, batch, _BUFFERS)):
        return 0
    buffers = _follow(data, at)
    (count,) = struct.unpack_from("<I", data, buffers)
    listed = data[buffers + 4 : buffers + 4 + _BUFFER.size * count]
    if len(listed) != _BUFFER.size * count:
        raise IndexError("a list of buffers")
    body, total = memoryview(message.body), 0
    for offset, length in _BUFFER.iter_unpack(listed):
        if length:
            if min(offset, length) < 0 or offset + length > len(body):
                raise IndexError("a buffer")
            total += max(0, *struct.unpack_from("<q", body, offset))
    return total


def _follow(data: bytes, at: int) -> int:
    """Where the distance that stands at a place leads."""
    return at + int(struct.unpack_from("<I", data, at)[0])


def _field(data: bytes, table: int, number: int) -> int:
    """Where a field of a table stands; 0 where it has none."""
    places = table - struct.unpack_from("<i", data, table)[0]
    if places < 0:
        raise IndexError("a table")
    (size,) = struct.unpack_from("<H", data, places)
    at = 4 + 2 * number
    if at + 2 > size:
        return 0
    offset = struct.unpack_from("<H", data, places + at)[0]
    return table + offset if offset else 0


FILE, STREAM = b"ARROW1\0\0", b"\xff\xff\xff\xff"


def accepts(head: bytes) -> bool:
    """Whether a file begins like an Arrow file, or like a stream: its first message is a schema.

    >>> accepts(b"ARROW1\\0\\0" + bytes(8)), accepts(b"\\xff" * 8)
    (True, False)
    """
    size = int.from_bytes(head[4:8], "little")
    return head.startswith(FILE) or (head.startswith(STREAM) and 0 < size < 1 << 24)


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that an Arrow table is; `unit` is that of the field where no column names one."""
    columns = _read_columns(path)
    names = list(columns)
    wanted = find_columns(rename_headers(names))
    table = {name: columns[names[i]].to_numpy() for i, name in wanted.items()}
    return build_tables_log(
        table,
        path=path,
        source=source,
        format="Arrow table",
        unit=unit,
        others=[name for i, name in enumerate(names) if i not in wanted],
    )


def _read_columns(path: Path) -> dict[str, Any]:
    """The columns by name, those of structures by dotted names, vectors by [0], [1], [2]."""
    try:
        import pyarrow as pa
    except ImportError:
        raise MissingExtraError("reading an Arrow file", "tables") from None
    stored = path.stat().st_size
    batches, size = [], 0
    check_declared(stored, stored)
    with pa.BufferReader(path.read_bytes()) as file:  # no message can ask for more than there is
        whole = file.read(len(FILE)) == FILE
        file.seek(len(FILE) if whole else 0)
        check_declared(count_unpacked_bytes(pa, file), stored)
        file.seek(0)
        reader = pa.ipc.open_file(file) if whole else pa.ipc.open_stream(file)
        for number in range(reader.num_record_batches) if whole else iter(int, 1):
            try:
                batch = reader.get_batch(number) if whole else reader.read_next_batch()
            except StopIteration:
                break
            batch.validate(full=True)  # offsets in it may lead anywhere
            size += max(batch.nbytes, 8 * batch.num_rows)  # columns of nothing take none
            check_declared(size, stored)
            batches.append(batch)
    if not batches:
        raise LogError("it holds no rows")
    table = pa.Table.from_batches(batches).flatten().flatten()
    return {name: part for at, field in enumerate(table.schema)
            for name, part in _take_apart(pa, field, table.column(at)).items()}  # fmt: skip


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
