"""A table of several stations and sensors, taken apart.

Rows are taken apart before anything is said of their times, because the clock of a logger starts
anew at every station.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Index
from agonic.errors import LogError
from agonic.logs import parquet
from agonic.logs.formats import PARQUET, TEXT
from agonic.logs.headers.column_names import ColumnNames, names_for
from agonic.logs.headers.columns import (
    find_quantities,
    identify_column,
    identify_columns,
)
from agonic.logs.read import open_log
from agonic.logs.rows.order import continue_time
from agonic.logs.table import build_log
from agonic.logs.text import csv_text
from agonic.provenance import Input, hash_file
from agonic.samples import Samples
from agonic.thermal.fit.readings import KELVIN

Table = dict[str, NDArray[Any]]

_MOST_STATIONS = 999
_WARMEST_C = 200.0
"""A chamber's median temperature above this is in kelvin, whatever the header says."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """The readings of one station in one file: samples by the name of the sensor in the file.

    `station` is `None` where the file does not say; `kelvin` names sensors whose temperatures were
    in kelvin without saying so; `failures` say what could not be read; `restarts` are the seconds
    after the first reading at which the clock of a sensor began anew.
    """

    station: int | None
    sensors: Mapping[str, Samples]
    kelvin: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()
    restarts: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


def split_table(table: Table, path: Path, source: Input, unit: str | None) -> Iterator[Part]:
    """The readings by station."""
    found, quantity = identify_columns(table), find_quantities(table)
    hot = _convert_to_celsius(table)
    stations = next(iter(found.get("station", {"": {}}).values())).get("")
    labels = next(iter(found.get("sensor", {"": {}}).values())).get("")
    failures: list[str] = []
    for number, rows in _split_by_station(table, None if stations is None else stations.header):
        sensors: dict[str, Samples] = {}
        restarts: dict[str, tuple[float, ...]] = {}
        failures = []
        for label, own in _split_by_sensor(rows, None if labels is None else labels.header):
            plain = {h: v for h, v in own.items() if quantity[h] not in ("station", "sensor")}
            joined, begun = _join_restarts(plain, quantity)
            try:
                log = build_log(joined, path=path, source=source, format="table", unit=unit)
            except LogError as error:
                failures.append(f"{label}: {error}" if label else str(error))
                continue
            failures += log.notes
            for samples in log.sensors:
                name = samples.name
                if label:
                    name = label if len(log.sensors) == 1 else f"{label} {samples.name}"
                sensors[name] = replace(samples, name=name)
                restarts |= {name: begun} if begun else {}
        kelvin = tuple(sensors) if hot else ()
        if sensors or failures:
            yield Part(
                station=number,
                sensors=sensors,
                kelvin=kelvin,
                failures=tuple(failures),
                restarts=restarts,
            )


def _convert_to_celsius(table: Table) -> bool:
    """Take 273.15 off temperatures that are kelvin although nothing says so; whether there were."""
    hot = False
    for header, values in table.items():
        column = identify_column(header)
        if (
            column is None
            or column.quantity.column != "temperature"
            or values.dtype.kind not in "iuf"
        ):
            continue
        if column.unit in (None, "c", "degc", "celsius") and np.nanmedian(values) > _WARMEST_C:
            table[header] = values - KELVIN
            hot = True
    return hot


def _split_by_station(table: Table, header: str | None) -> Iterator[tuple[int | None, Table]]:
    """The rows of each station that a column numbers."""
    if header is None:
        yield None, table
        return
    values = table[header].astype(np.float64, copy=False)
    whole = np.isfinite(values) & (values == np.round(values)) & (abs(values) <= _MOST_STATIONS)
    numbers = np.unique(values[whole])
    if not len(numbers):
        raise LogError(f"{header!r} holds no numbers of stations")
    for number in numbers:
        yield int(number), _select_rows(table, np.flatnonzero(values == number))


def _split_by_sensor(table: Table, header: str | None) -> Iterator[tuple[str, Table]]:
    """The rows of each sensor that a column names."""
    if header is None:
        yield "", table
        return
    known: defaultdict[Any, int] = defaultdict(count().__next__)
    values = table[header]
    codes = np.fromiter(map(known.__getitem__, values.tolist()), np.intp, len(values))
    for label, code in list(known.items()):
        yield str(label).strip(), _select_rows(table, np.flatnonzero(codes == code))


def _select_rows(table: Table, at: Index) -> Table:
    """Some rows of a table; a view where they are one stretch."""
    if len(at) and at[-1] - at[0] + 1 == len(at):
        chosen: Any = slice(int(at[0]), int(at[-1]) + 1)
    else:
        chosen = at
    return {header: values[chosen] for header, values in table.items()}


def _join_restarts(table: Table, quantity: Mapping[str, str]) -> tuple[Table, tuple[float, ...]]:
    """The table with clocks that begin anew going on instead, and the seconds at which they did."""
    begun: tuple[float, ...] = ()
    for header, values in table.items():
        if quantity[header] != "time" or values.dtype.kind not in "iuf":
            continue
        column = identify_column(header)
        factor = column.quantity.units[column.unit][0] if column and column.unit else 1.0
        time = values.astype(np.float64, copy=False) * factor
        joined, notes = continue_time(time, np.arange(float(len(time)))[:, None])
        if notes:
            rows = np.flatnonzero(np.diff(time) < 0) + 1
            begun = tuple((joined[rows] - joined[0]).tolist())
            table = {**table, header: joined / factor}
    return table, begun


WANTED = ("time", "date", "epoch", "field", "temperature", "station", "sensor")
"""The quantities that a campaign is about."""

_HEAD_BYTES = 65536


@dataclass(frozen=True, kw_only=True)
class RecordedFile:
    """What a file of a campaign holds, and notes on the file."""

    parts: tuple[Part, ...]
    source: Input
    notes: tuple[str, ...] = field(default_factory=tuple)


def read_recording(
    path: Path, unit: str | None = None, names: ColumnNames | None = None
) -> RecordedFile:
    """The readings in a file of a campaign, by station and sensor.

    `unit` is that of the field where no header names one, `names` what its columns are where
    headers do not say. Raises `LogError` where nothing in the file can be used.
    """
    with names_for(path, names) as given:
        return _read_named(path, unit or (None if given is None else given.unit))


def _read_named(path: Path, unit: str | None) -> RecordedFile:
    """The readings in a file whose columns have their names."""
    with path.open("rb") as stream:
        head = stream.read(_HEAD_BYTES)
    is_parquet = PARQUET.accepts(head)
    if not is_parquet and not TEXT.accepts(head):
        log = open_log(path, unit=unit)
        part = Part(station=None, sensors={samples.name: samples for samples in log.sensors})
        return RecordedFile(parts=(part,), source=log.source, notes=log.notes)
    try:
        table, notes = _read_table(path, is_parquet)
        source = Input(name=path.name, sha256=hash_file(path), count=len(_take_first(table)))
        parts = tuple(split_table(table, path, source, unit))
    except LogError as error:
        raise error if error.path else LogError(str(error), path=path) from error
    except Exception as error:  # parsers fail on damaged files in every way there is
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:160]
        raise LogError(f"damaged, or not what it looks like ({reason})", path=path) from error
    return RecordedFile(parts=parts, source=source, notes=notes)


def _read_table(path: Path, columnar: bool) -> tuple[Table, tuple[str, ...]]:
    """The wanted columns of a file, and notes."""
    notes: tuple[str, ...] = ()
    if columnar:
        table, _ = parquet.read_table(path)
    else:
        table, facts = csv_text.read_table(path)
        notes = facts.get("notes", ())
    quantity = find_quantities(table)
    wanted = {header: values for header, values in table.items() if quantity[header] in WANTED}
    return wanted, notes


def _take_first(table: Table) -> NDArray[Any]:
    if not table:
        raise LogError(
            "no column of it is understood; name them time_s, mag_x_uT, temperature_C …, or say "
            "which they are: --columns time_s=…,x=…,y=…,z=…,temperature_C=… or columns in "
            "campaign.toml"
        )
    return next(iter(table.values()))
