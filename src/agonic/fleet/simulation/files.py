"""The logs of many sensors: a folder of files, one Parquet dataset, the table of their truth."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Mask
from agonic.atomic import check_target, make_folder, replacing
from agonic.errors import AgonicError, MissingExtraError
from agonic.exports.csv import write_table
from agonic.fleet.simulation.faults import DAMAGED, damage
from agonic.fleet.simulation.simulate import RecordedLogs, SimulatedFleet

HEADER = (
    "time_s,mag_x_nT,mag_y_nT,mag_z_nT,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2,temperature_C,epoch_unix_s"
)


def make_texts(fleet: SimulatedFleet) -> Iterator[tuple[str, bytes]]:
    """The name and the bytes of every file, copies beside what they repeat."""
    holding = _group_logs(fleet)
    for recorded in fleet.readings():
        for k in range(len(recorded.field)):
            content = _make_text(fleet, recorded, k)
            for log in holding[recorded.first + k]:
                fault = fleet.truth["fault"][log]
                name = f"{fleet.truth['source'][log]}.csv"
                yield name, damage(fault, content, log) if fault in DAMAGED else content


def make_tables(
    fleet: SimulatedFleet, *, acceleration: bool = True
) -> Iterator[Mapping[str, NDArray[Any]]]:
    """The readings of some hundred logs at a time, as columns, each row with its sensor. A dataset
    has no files to be damaged: such a log is cut to five rows, or has lost half its values. A log
    that is there twice is one of a sensor of its own, named as the copy."""
    holding, truth = _group_logs(fleet), fleet.truth
    for recorded in fleet.readings():
        logs = [(k, log) for k in range(len(recorded.field)) for log in holding[recorded.first + k]]
        rows = np.array([k for k, _ in logs])
        names = [str(truth["source" if truth["original"][i] else "sensor"][i]) for _, i in logs]
        field = recorded.field[rows].astype(np.float32)
        whole = np.ones(field.shape[:2], dtype=bool)
        for k, (_, log) in enumerate(logs):
            if truth["group"][log] == "damaged":
                _damage(str(truth["fault"][log]), field[k], whole[k], log)
        count = field.shape[1]
        start_s = np.array([truth["start"][i].timestamp() for _, i in logs])
        time = (start_s[:, None] + recorded.time)[whole]
        table: dict[str, NDArray[Any]] = {"sensor": np.repeat(np.array(names, object), count)}
        table["sensor"] = table["sensor"][whole.ravel()]
        table["time_s"] = time
        _put_vectors(table, "mag_{}_nT", field, whole)
        if acceleration:
            force = recorded.acceleration[rows].astype(np.float32)
            _put_vectors(table, "acc_{}_m_s2", force, whole)
        table["temperature_C"] = recorded.temperature[rows].astype(np.float32)[whole]
        yield table


def _put_vectors(
    table: dict[str, NDArray[Any]], name: str, vectors: NDArray[Any], whole: Mask
) -> None:
    """Put the three components of vectors (k, m, 3) into a table."""
    for axis, component in zip("xyz", np.moveaxis(vectors, -1, 0), strict=True):
        table[name.format(axis)] = component[whole]


def _damage(fault: str, field: NDArray[Any], whole: Mask, seed: int) -> None:
    """Lose values or rows of one log."""
    if fault == "missing values":
        lost = np.random.default_rng([seed, 11]).uniform(size=len(field)) < 0.5
        field[lost, 0] = np.nan
    else:
        whole[5:] = False


def _group_logs(fleet: SimulatedFleet) -> Mapping[int, list[int]]:
    """The logs that hold each drawn one: itself, and its copy."""
    holding: dict[int, list[int]] = defaultdict(list)
    for log, drawn in enumerate(fleet.draw.tolist()):
        holding[drawn].append(log)
    return holding


def _make_text(fleet: SimulatedFleet, recorded: RecordedLogs, k: int) -> bytes:
    """One log as a table of text, written by one format for all its rows."""
    log = recorded.first + k
    start = fleet.truth["start"][log].timestamp()
    row = f"%.2f,%.0f,%.0f,%.0f,%.3f,%.3f,%.3f,%.2f,{start:.0f}\n"
    columns = (
        recorded.time,
        recorded.field[k],
        recorded.acceleration[k],
        recorded.temperature[k],
    )
    values = np.column_stack(columns).ravel().tolist()
    return f"{HEADER}\n{row * len(recorded.time) % tuple(values)}".encode()


ROW_GROUP = 500_000
"""Rows of a Parquet file that are written, and read, together."""


def write_logs(logs: Iterable[tuple[str, bytes]], folder: Path | str) -> list[Path]:
    """Write every log under its name, and return the paths. They are written without waiting for
    the disk after each, which would take longer than all else; what tells that a folder is whole is
    the table of the truth, written last."""
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
    """Write tables of the same columns, one after the other, as one Parquet file."""
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
    """Write a table whose columns may hold vectors and matrices, as CSV: `bias_x`, `matrix_xx`,
    …."""
    columns: dict[str, list[object]] = {}
    for name, values in truth.items():
        names = [name]
        for _ in values.shape[1:]:
            names = [f"{n}{'_' if n == name else ''}{axis}" for n in names for axis in "xyz"]
        flat = values.reshape(len(values), -1)
        for column, values_of in zip(names, flat.T.tolist(), strict=True):
            columns[column] = [v.isoformat() if isinstance(v, datetime) else v for v in values_of]
    return write_table(columns, path)


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
