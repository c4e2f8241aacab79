"""The logs of many sensors: a folder of files, one Parquet dataset, the table of their truth."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.atomic import check_target, make_folder, replacing, write_atomically
from agonic.errors import AgonicError, MissingExtraError

ROW_GROUP = 500_000
"""Rows of a Parquet file that are written, and read, together."""


def write_logs(logs: Iterable[tuple[str, bytes]], folder: Path | str) -> list[Path]:
    """Write every log under its name, and return the paths.

    They are written without waiting for the disk after each, which would take longer than all
    else; what tells that a folder is whole is the table of the truth, written last.

    >>> from tempfile import TemporaryDirectory

    >>> with TemporaryDirectory() as folder:
    ...     write_logs([("a.csv", b"time_s")], folder)[0].read_bytes()
    b'time_s'
    """
    home = make_folder(folder)
    paths = []
    try:
        for name, content in logs:
            path = home / name
            check_target(path, content)
            path.write_bytes(content)
            paths.append(path)
    except OSError as error:
        raise AgonicError(f"cannot write {path}: {error.strerror or error}") from error
    return paths


def write_dataset(tables: Iterable[Mapping[str, NDArray[Any]]], path: Path | str) -> Path:
    """Write tables of the same columns, one after the other, as one Parquet file.

    Raises `MissingExtraError` without pyarrow.

    >>> from tempfile import TemporaryDirectory

    >>> with TemporaryDirectory() as folder:
    ...     table = {"sensor": np.array(["a", "b"], dtype=object)}
    ...     write_dataset([table], folder + "/all.parquet").name
    'all.parquet'
    """
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError:
        raise MissingExtraError("a dataset of many sensors", "fleet") from None
    make_folder(Path(path).parent)
    with replacing(path) as part:
        writer = None
        for table in _group_tables(tables):
            arrow = pa.table({name: _encode(pa, column) for name, column in table.items()})
            if writer is None:
                writer = parquet.ParquetWriter(part, arrow.schema, compression="zstd")
            writer.write_table(arrow, row_group_size=ROW_GROUP)
        if writer is None:
            raise AgonicError("there are no readings to write")
        writer.close()
    return Path(path)


def write_truth(truth: Mapping[str, NDArray[Any]], path: Path | str) -> Path:
    """Write a table whose columns may hold vectors and matrices, as CSV: `bias_x`, `matrix_xx`, ….

    >>> from tempfile import TemporaryDirectory

    >>> with TemporaryDirectory() as folder:
    ...     truth = {"sensor": np.array(["a"]), "bias": np.ones((1, 3))}
    ...     write_truth(truth, folder + "/t.csv").read_text().split()
    ['sensor,bias_x,bias_y,bias_z', 'a,1.0,1.0,1.0']
    """
    columns: dict[str, list[Any]] = {}
    for name, values in truth.items():
        names = [name]
        for _ in values.shape[1:]:
            names = [f"{n}{'_' if n == name else ''}{axis}" for n in names for axis in "xyz"]
        flat = values.reshape(len(values), -1)
        columns |= {n: _make_plain(flat[:, k]) for k, n in enumerate(names)}
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return write_atomically(path, stream.getvalue())


def _make_plain(column: NDArray[Any]) -> list[Any]:
    return [v.isoformat() if hasattr(v, "isoformat") else v for v in column.tolist()]


def _group_tables(
    tables: Iterable[Mapping[str, NDArray[Any]]],
) -> Iterator[Mapping[str, NDArray[Any]]]:
    """Tables joined to such as fill a row group."""
    waiting: list[Mapping[str, NDArray[Any]]] = []
    rows = 0
    for table in tables:
        waiting.append(table)
        rows += len(next(iter(table.values())))
        if rows >= ROW_GROUP:
            yield _join(waiting)
            waiting, rows = [], 0
    if waiting:
        yield _join(waiting)


def _join(tables: list[Mapping[str, NDArray[Any]]]) -> Mapping[str, NDArray[Any]]:
    return {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}


def _encode(pa: Any, column: NDArray[Any]) -> Any:
    """A column for Parquet; names, which repeat, by a dictionary."""
    array = pa.array(column)
    return array.dictionary_encode() if column.dtype == object else array
