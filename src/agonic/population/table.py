"""A population as a Parquet table: the same rows give the same bytes."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.atomic import write_atomically
from agonic.errors import LogError, MissingExtraError
from agonic.population.population import COLUMNS, Population, get_dtype, make_column

SCHEMA = b"agonic/population@1"


def write_population(population: Population, path: Path | str) -> Path:
    """Write the table as Parquet, a row for each; `read_population` reads it.

    Parameters
    ----------
    population : the rows.
    path : of the file; it is replaced in one step.

    Returns the path. Raises `AgonicError` where it cannot be written.

    Source: Apache Parquet, through pyarrow.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from agonic.population import Row
    >>> row = Row(sensor="a", source="a.csv", verdict="refused", status="empty")
    >>> with TemporaryDirectory() as folder:
    ...     path = write_population(Population.of([row]), folder + "/table.parquet")
    ...     read_population(path)["sensor"].tolist()
    ['a']
    """
    return write_atomically(path, to_bytes(population))


def to_bytes(population: Population) -> bytes:
    """The table as the bytes of a Parquet file."""
    pa, parquet = _import_arrow()
    kinds = {"device_id": pa.int64(), "start": pa.timestamp("us", "UTC")}
    kinds["findings"] = pa.list_(pa.string())
    fields, arrays = [], []
    for name, column in population.columns.items():
        kind = kinds.get(name) or (
            pa.string() if column.dtype == object else pa.from_numpy_dtype(column.dtype)
        )
        fields.append(pa.field(name, kind))
        missing = np.isnan(column) if column.dtype == np.float64 else None
        arrays.append(pa.array(column, kind, mask=missing))
    schema = pa.schema(fields, metadata={b"schema": SCHEMA})
    stream = BytesIO()
    parquet.write_table(pa.table(arrays, schema=schema), stream, compression="zstd")
    return stream.getvalue()


def read_population(path: Path | str) -> Population:
    """The population that `write_population` wrote.

    Parameters
    ----------
    path : of the Parquet table.

    Raises `LogError` where the file is not such a table.

    Source: Apache Parquet, through pyarrow.

    Examples
    --------
    >>> read_population("nowhere.parquet")
    Traceback (most recent call last):
    agonic.errors.LogError: nowhere.parquet: there is no such file
    """
    path = Path(path)
    if not path.is_file():
        raise LogError("there is no such file", path=path)
    try:
        return from_bytes(path.read_bytes())
    except LogError as error:
        raise LogError(str(error), path=path) from None


def from_bytes(content: bytes) -> Population:
    """The population that `to_bytes` gave the bytes of; `LogError` where they are none."""
    pa, parquet = _import_arrow()
    try:
        table = parquet.read_table(pa.BufferReader(content))
    except (pa.ArrowException, OSError, ValueError, MemoryError) as error:
        raise LogError(f"it is not a Parquet table: {error}") from None
    if (table.schema.metadata or {}).get(b"schema") != SCHEMA:
        raise LogError("it is not a table of calibrations, as agonic fleet writes")
    try:
        table.validate(full=True)
        return Population({name: _read_column(name, table.column(name)) for name in COLUMNS})
    except (pa.ArrowException, LookupError, ValueError, TypeError, OverflowError) as error:
        raise LogError(f"it is damaged ({error}); make it anew with agonic fleet") from None


def _read_column(name: str, column: Any) -> NDArray[Any]:
    """A column as `Population` keeps it."""
    if get_dtype(name) is not object:
        return np.asarray(column.to_numpy(), dtype=get_dtype(name))
    values = column.to_pylist()
    return make_column(name, [*map(tuple, values)] if name == "findings" else values)


def _import_arrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise MissingExtraError("a table of many calibrations", "fleet") from None
    return pyarrow, parquet
