"""The rows of single sensors of a dataset, sensor by sensor."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Index
from agonic.logs.large.dataset import Dataset, quote, select_table
from agonic.logs.large.grouped_moments import select_clock

Table = Mapping[str, NDArray[Any]]

_BATCH = 50_000  # rows


def read_tables(db: Any, dataset: Dataset, ids: Index) -> Iterator[tuple[int, Table]]:
    """The id of each of these sensors that `summed` listed, with its rows as a table, in its order.

    All columns that are understood, in order of time. DuckDB sorts the rows, on disk where they
    are more than its memory, so that one sensor at a time is held here.
    """
    import pyarrow as pa

    db.register("wanted", pa.table({"id": np.asarray(ids, dtype=np.int64)}))
    db.execute("create or replace temp table chosen as select * from wanted")
    db.unregister("wanted")
    headers = dataset.headers
    columns = ", ".join(f"{quote(header)} as c{k}" for k, header in enumerate(headers))
    rows = (
        f"select {quote(dataset.sensor)} as sensor, {select_clock(dataset)} as t, filename, "
        f"file_row_number, {columns} from {select_table(dataset.files)}"
    )
    kept = ", ".join(f"c{k}" for k in range(len(headers)))
    query = (
        f"select id, {kept} from ({rows}) join sensors using (sensor) join chosen using (id) "
        "order by id, t, filename, file_row_number"
    )
    open_: list[Any] = []
    for batch in db.sql(query).to_arrow_reader(_BATCH):
        ids_here = batch.column(0).to_numpy()
        edges = np.flatnonzero(np.diff(ids_here)) + 1
        starts = [0, *edges.tolist(), len(ids_here)]
        for start, stop in pairwise(starts):
            part = batch.slice(start, stop - start)
            if open_ and open_[-1].column(0)[0] != part.column(0)[0]:
                yield _whole(open_, headers)
                open_ = []
            open_.append(part)
    if open_:
        yield _whole(open_, headers)


def _whole(parts: list[Any], headers: tuple[str, ...]) -> tuple[int, Table]:
    """The pieces of one sensor as a table."""
    import pyarrow as pa

    joined = pa.Table.from_batches(parts)
    columns = {header: _plain(joined.column(k + 1)) for k, header in enumerate(headers)}
    return int(joined.column(0)[0].as_py()), columns


def _plain(column: Any) -> NDArray[Any]:
    """A column as NumPy has it; a decimal as a number."""
    import pyarrow as pa

    if pa.types.is_decimal(column.type):
        column = column.cast(pa.float64())
    return np.asarray(column.to_numpy())
