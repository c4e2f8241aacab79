"""`Dataset`: readings of many sensors in one Parquet table, told apart by a column."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from agonic.arrays import Index
from agonic.errors import AgonicError, LogError, MissingExtraError
from agonic.logs.formats import PARQUET
from agonic.logs.headers.columns import Identified, identify_columns
from agonic.logs.headers.header import Column, name_quantity
from agonic.logs.headers.quantities import DOCUMENT, squash
from agonic.logs.log import Table
from agonic.provenance import hash_file
from agonic.units import RAW, find_unit, nanotesla_per


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
    """A column's name in SQL."""
    return '"' + name.replace('"', '""') + '"'


def quote_literal(text: str) -> str:
    """A text in SQL."""
    return "'" + text.replace("'", "''") + "'"


def database_error_type() -> type[Exception]:
    import duckdb

    return duckdb.Error


SENSOR_COLUMNS = frozenset(DOCUMENT["headers"]["sensor_columns"].split())
"""Names of the column that tells sensors apart, where none is given; case, blanks and punctuation
do not count."""

NUMBERS = ("TINYINT", "SMALLINT", "INTEGER", "BIGINT", "FLOAT", "DOUBLE", "DECIMAL", "U", "HUGE")
_SUFFIXES = (".parquet", ".parq", ".pq")


@dataclass(frozen=True, kw_only=True)
class Channel:
    """The three columns of one magnetometer, its name, and the unit of its readings."""

    name: str
    axes: tuple[str, str, str]
    unit: str

    @property
    def factor(self) -> float:
        """One of the column's numbers in the unit of the result: nT, or raw."""
        return nanotesla_per(self.unit)

    @property
    def unit_in(self) -> str:
        """The unit of the result."""
        return RAW if find_unit(self.unit) == RAW else "nT"


@dataclass(frozen=True, kw_only=True)
class Dataset:
    """A Parquet file, or a folder of them, with readings of many sensors.

    `sensor` names the column (or the key of the folders, as in `sensor=17/`) that tells them
    apart; `files` are those that are read, `damaged` those that cannot be, with the reason;
    `columns` (header → type) are all there are, `found` what they are understood as.
    """

    path: Path
    files: tuple[str, ...]
    sensor: str
    columns: dict[str, str]
    unit: str | None = None
    damaged: tuple[tuple[str, str], ...] = ()

    @cached_property
    def found(self) -> Identified:
        """The columns that are understood, the one that names the sensor apart."""
        return identify_columns(
            header
            for header, kind in self.columns.items()
            if header != self.sensor
            and (quantity := name_quantity(header))
            and (quantity != "field" or kind.startswith(NUMBERS))
        )

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The magnetometers of each sensor; `LogError` where there is none."""
        fields = self.found.get("field", {})
        made = tuple(
            Channel(
                name=f"mag{number}",
                axes=(columns["x"].header, columns["y"].header, columns["z"].header),
                unit=self._unit(columns),
            )
            for number, columns in fields.items()
            if len(columns) == 3
        )
        if not made:
            raise LogError(
                "no magnetometer columns found beside the sensor's; name them mag_x_uT, mag_y_uT, "
                "mag_z_uT or the like",
                path=self.path,
            )
        return made

    @property
    def headers(self) -> tuple[str, ...]:
        """The headers of all columns that are understood."""
        groups = (axes for by_number in self.found.values() for axes in by_number.values())
        return tuple(column.header for axes in groups for column in axes.values())

    def column(self, quantity: str) -> Column | None:
        """The column of a quantity that is a single one, such as the temperature."""
        groups = self.found.get(quantity, {})
        axes = groups.get("") or (next(iter(groups.values())) if len(groups) == 1 else {})
        return axes.get("")

    @cached_property
    def sha256(self) -> str:
        """The digest of the content: of the file, or of all files' digests and names."""
        if Path(self.files[0]) == self.path and len(self.files) == 1:
            return hash_file(self.path)
        lines = (f"{hash_file(Path(f))}  {os.path.relpath(f, self.path)}\n" for f in self.files)
        return hashlib.sha256("".join(lines).encode()).hexdigest()

    def _unit(self, columns: dict[str, Column]) -> str:
        units = {column.unit for column in columns.values()}
        if len(units) > 1:
            raise LogError("the axes are in different units; give them one", path=self.path)
        named = units.pop()
        return (self.unit or RAW) if named in (None, RAW) else str(named)


def find_dataset(
    path: Path | str,
    sensor_column: str | None = None,
    *,
    unit: str | None = None,
    files: Sequence[str] | None = None,
) -> Dataset | None:
    """The dataset that a Parquet file or a folder of them is; None where it is none. A folder is
    read with all that is below, or its `files`; keys in the names of folders (`sensor=17/`) are
    columns. `sensor_column` tells sensors apart; without, one of `SENSOR_COLUMNS`. `unit` is that
    of the field where no column names one."""
    path = Path(path)
    readable, damaged = _readable(_parquet_files(path) if files is None else sorted(files))
    if not readable:
        return None
    with connect() as db:
        columns = _columns(db, path, readable)
    sensor = _sensor_column(columns, sensor_column, path)
    if sensor is None:
        return None
    return Dataset(
        path=path, files=readable, sensor=sensor, columns=columns, unit=unit, damaged=damaged
    )


def drop_damaged(dataset: Dataset) -> Dataset:
    """The dataset without those of its files that cannot be read to their end."""
    damaged = list(dataset.damaged)
    with connect() as db:
        for file in dataset.files:
            try:
                used = ", ".join(map(quote, (dataset.sensor, *dataset.headers)))
                db.execute(f"select max(hash({used})) from {select_table([file])}").fetchall()
            except database_error_type() as error:
                other = type(error).__name__ == "BinderException"
                why = "it lacks columns of the others, give it by itself: " if other else ""
                damaged.append((file, why + _first_line(error)))
    lost = {file for file, _ in damaged}
    files = tuple(file for file in dataset.files if file not in lost)
    if not files:
        raise LogError(f"no file of it can be read: {damaged[0][1]}", path=dataset.path)
    return replace(dataset, files=files, damaged=tuple(damaged))


def _parquet_files(path: Path) -> list[str]:
    if path.is_file():
        with path.open("rb") as stream:
            return [str(path)] if PARQUET.accepts(stream.read(4)) else []
    if not path.is_dir():
        raise LogError("there is no such file or folder", path=path)
    return sorted(
        str(file)
        for file in path.rglob("*")
        if file.suffix.lower() in _SUFFIXES
        and not file.name.startswith((".", "_"))
        and file.is_file()
    )


def _readable(files: Sequence[str]) -> tuple[tuple[str, ...], tuple[tuple[str, str], ...]]:
    """The files whose footer can be read, and the others with the reason."""
    try:
        from pyarrow import ArrowException
        from pyarrow.parquet import read_metadata
    except ImportError:
        raise MissingExtraError("a dataset of many sensors", "fleet") from None
    good, damaged = [], []
    for file in files:
        try:
            rows = read_metadata(file).num_rows
        except (ArrowException, OSError, UnicodeError) as error:
            damaged.append((file, _first_line(error)))
            continue
        if rows:
            good.append(file)
    return tuple(good), tuple(damaged)


def _columns(db: Any, path: Path, files: Sequence[str]) -> dict[str, str]:
    try:
        described = db.execute(f"describe select * from {select_table(files)}").fetchall()
    except database_error_type() as error:
        raise LogError(f"its files do not form a table: {_first_line(error)}", path=path) from None
    return {
        row[0]: str(row[1]) for row in described if row[0] not in ("filename", "file_row_number")
    }


def _sensor_column(columns: dict[str, str], given: str | None, path: Path) -> str | None:
    if given is not None:
        if given not in columns:
            raise LogError(f"no column {given!r}; there are {', '.join(columns)}", path=path)
        return given
    found = [name for name in columns if squash(name).lower() in SENSOR_COLUMNS]
    if len(found) > 1:
        raise AgonicError(
            f"{path}: {' and '.join(found)} could both tell the sensors apart; say which "
            "(--sensor-column)"
        )
    return found[0] if found else None


def select_clock(dataset: Dataset) -> str:
    """The SQL of a number that grows with time: of the clock, or else the row's place in its file.
    It is in seconds, but for a numeric column, which is taken as it is."""
    column = dataset.column("time")
    if column is None:
        return "file_row_number::double"
    kind = dataset.columns[column.header]
    if kind.startswith(NUMBERS):
        return f"{quote(column.header)}::double"
    if kind.startswith(("TIMESTAMP", "DATE")):
        return f"epoch({quote(column.header)})"
    return f"epoch(try_cast({quote(column.header)} as timestamptz))"


def read_tables(db: Any, dataset: Dataset, ids: Index) -> Iterator[tuple[int, Table]]:
    """The id of each of these sensors that `summed` listed, with its rows as a table, in its order.
    All columns that are understood, in order of time. DuckDB sorts the rows, on disk where they are
    more than its memory, so that one sensor at a time is held here."""
    import pyarrow as pa

    db.register("wanted", pa.table({"id": np.asarray(ids, dtype=np.int64)}))
    db.execute("create or replace temp table chosen as select * from wanted")
    db.unregister("wanted")
    columns = ", ".join(f"{quote(header)} as c{k}" for k, header in enumerate(dataset.headers))
    rows = (
        f"select {quote(dataset.sensor)} as sensor, {select_clock(dataset)} as t, filename, "
        f"file_row_number, {columns} from {select_table(dataset.files)}"
    )
    kept = ", ".join(f"c{k}" for k in range(len(dataset.headers)))
    query = (
        f"select id, {kept} from ({rows}) join sensors using (sensor) join chosen using (id) "
        "order by id, t, filename, file_row_number"
    )
    gathered: list[Any] = []
    for batch in db.sql(query).to_arrow_reader(50_000):
        edges = np.flatnonzero(np.diff(batch.column(0).to_numpy())) + 1
        for start, stop in pairwise([0, *edges.tolist(), batch.num_rows]):
            part = batch.slice(start, stop - start)
            if gathered and gathered[-1].column(0)[0] != part.column(0)[0]:
                yield _join(gathered, dataset.headers)
                gathered = []
            gathered.append(part)
    if gathered:
        yield _join(gathered, dataset.headers)


def _join(parts: list[Any], headers: tuple[str, ...]) -> tuple[int, Table]:
    """The pieces of one sensor as a table; decimals as numbers."""
    import pyarrow as pa

    joined = pa.Table.from_batches(parts)
    columns = {}
    for k, header in enumerate(headers):
        column = joined.column(k + 1)
        decimal = pa.types.is_decimal(column.type)
        columns[header] = np.asarray((column.cast(pa.float64()) if decimal else column).to_numpy())
    return int(joined.column(0)[0].as_py()), columns


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
