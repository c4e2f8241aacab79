"""Readings in any form that people have them in: samples, an array, a table of columns, a file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from agonic.errors import AgonicError, LogError
from agonic.logs.log import Facts
from agonic.logs.read import read
from agonic.logs.table import build_log
from agonic.maths.moments_of_time import count_seconds, has_moments
from agonic.provenance import Input
from agonic.samples import Samples
from agonic.units import RAW

Given = Samples | ArrayLike | Mapping[str, ArrayLike] | Path | str
"""What a fit takes for its readings."""


def as_samples(given: Given, unit: str | None = None) -> Samples:
    """The samples that were meant by `Samples`; by readings (n, 3) as an array or lists; by a
    DataFrame of pandas or polars, a table of pyarrow, a record array of NumPy, an xarray Dataset or
    a mapping, whose columns are named as in a text table; or by the path of a recording. `unit` is
    that of the readings, where they do not say; else they are raw."""
    if isinstance(given, Samples):
        if unit is not None:
            raise AgonicError(
                f"unit={unit!r} was given with samples, which have theirs; leave it out"
            )
        if given.axes != "xyz":
            raise AgonicError(
                f"{given.name} has x and y alone and this needs three axes; a two-axis compass is "
                "calibrated with agonic calibrate, or agonic.ellipse.fit.fit_ellipse"
            )
        return given
    if isinstance(given, str | Path):
        return read(given, unit=unit)
    table: Any = given
    if hasattr(table, "data_vars"):
        table = table.to_dataframe().reset_index()
    names: Any = getattr(table, "column_names", getattr(table, "columns", None))
    if isinstance(table, Mapping | np.ndarray):  # of a record array
        names = table.keys() if isinstance(table, Mapping) else table.dtype.names
    named = isinstance(names, Iterable)
    return _read_table(table, names, unit) if named else _read_array(table, unit)


def _read_table(table: Any, names: Iterable[Any], unit: str | None) -> Samples:
    """The magnetometer of a table in memory; an index of moments is its time."""
    columns = {str(name): np.asarray(table[name]) for name in names}
    if len({len(column) for column in columns.values()}) != 1:
        raise LogError("the columns of a table have one length, and it has one column at least")
    index = getattr(table, "index", None)
    if index is not None and "time" not in columns and has_moments(index):
        seconds, epoch = count_seconds(index, None)
        spans = (1e9 * seconds).round().astype("timedelta64[ns]")
        begun = None if epoch is None else np.datetime64(epoch.replace(tzinfo=None), "ns")
        columns |= {"time_s": seconds} if begun is None else {"time": begun + spans}
    try:
        source = Input.of_array("table", np.arange(0.0))
        facts = Facts(path=Path("table"), source=source, format="table in memory", unit=unit)
        log = build_log(columns, **facts)
    except LogError as error:
        if len(columns) == 3 and all(column.dtype.kind in "iuf" for column in columns.values()):
            return _read_array(np.stack(list(columns.values()), axis=1), unit)
        raise LogError(f"a table in memory: {error}") from None
    if len(log.sensors) > 1:
        names = ", ".join(sensor.name for sensor in log.sensors)
        raise AgonicError(f"the table holds {names}; give the columns of one")
    return log.sensors[0].with_columns(source=None)


def _read_array(given: Any, unit: str | None) -> Samples:
    kind = type(given).__name__
    needed = "Samples, readings (n, 3), a table with named columns, or the path of a recording"
    try:
        array = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise AgonicError(f"readings were given as {kind}; needed are {needed}") from None
    if array.ndim != 2 or array.shape[1] != 3:
        raise AgonicError(
            f"readings were given as {kind} of shape {array.shape}; needed are {needed}"
        )
    return Samples(field=array, unit=unit or RAW)
