"""Arrow and Feather files and streams, with pyarrow; columns are named as those of a table are."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

from agonic.errors import LogError, MissingExtraError
from agonic.logs.contents import explain_damage
from agonic.logs.headers.column_names import rename_headers
from agonic.logs.headers.columns import find_columns
from agonic.logs.log import Facts, Log
from agonic.logs.text.long_table import build_tables_log
from agonic.provenance import Input

FILE, STREAM = b"ARROW1\0\0", b"\xff\xff\xff\xff"


def accepts(head: bytes) -> bool:
    """Whether a file begins like an Arrow file, or like a stream: its first message is a schema."""
    size = int.from_bytes(head[4:8], "little")
    return head.startswith(FILE) or (head.startswith(STREAM) and 0 < size < 1 << 24)


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that an Arrow table is; `unit` is that of the field where no column names one."""
    with explain_damage():
        columns = _read_columns(path)
    names = list(columns)
    wanted = find_columns(rename_headers(names))
    table = {name: columns[names[i]].to_numpy() for i, name in wanted.items()}
    others = [name for i, name in enumerate(names) if i not in wanted]
    facts = Facts(path=path, source=source, format="Arrow table", unit=unit, others=others)
    return build_tables_log(table, **facts)


def _read_columns(path: Path) -> dict[str, Any]:
    """The columns by name, those of structures by dotted names, vectors by [0], [1], [2]."""
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
    return {name: part for at, field in enumerate(table.schema)
            for name, part in _take_apart(pa, field, table.column(at)).items()}  # fmt: skip


def _read_batches(pa: Any, file: Any) -> Iterator[Any]:
    """The batches of a file or a stream, whose offsets may lead anywhere: each is checked."""
    whole = file.read(len(FILE)) == FILE
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
