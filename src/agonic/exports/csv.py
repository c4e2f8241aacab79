"""Samples as a table under the canonical names, which `read` reads back to the last digit."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from datetime import UTC
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from agonic.atomic import write_atomically
from agonic.errors import AgonicError, MissingExtraError
from agonic.logs.headers.quantities import canonical_header
from agonic.samples import Samples
from agonic.usable_rows import VECTORS

Table: TypeAlias = dict[str, list[float] | list[str]]


def write_csv(samples: Samples, path: Path | str) -> Path:
    """Write the columns of the samples, a row a sample, and return the path.

    Headers are `time_s, mag_x_nT, mag_y_nT, mag_z_nT, temperature_C, …` (`mag_x_raw` where the
    unit is not known; `yaw_deg` for a heading that is the estimate of a filter). The epoch, the
    name of the sensor and the letter of its axes, which belong to the whole table, are columns at
    the end, where they are not unknown, "mag" and "m". Notes and the correction that a log had
    applied (`logged`) are not written.

    Raises `AgonicError` where the file cannot be written.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     samples = Samples(time=[0.0, 0.1], field=[[1.5, 2.0, 3.0], [4.0, 5.0, 6.0]])
    ...     print(write_csv(samples, folder + "/samples.csv").read_text(), end="")
    time_s,mag_x_nT,mag_y_nT,mag_z_nT
    0.0,1.5,2.0,3.0
    0.1,4.0,5.0,6.0
    """
    return write_table(make_table(samples), path)


def write_sensors(sensors: Sequence[Samples], path: Path | str) -> Path:
    """Write magnetometers that were read at the same moments as one table, and return the path.

    Parameters: `sensors`, the samples of each; `path` of the table. Their readings are
    `mag1_x_nT, …, mag2_x_nT, …`, so they read back as "mag1", "mag2" and so on;
    all other columns and the epoch are those of the first.

    Raises `AgonicError` where a sensor has other times than the first, or the file cannot be
    written.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     pair = [Samples(time=[0.0], field=[[i, 2.0, 3.0]], name=f"mag{i}") for i in (1, 2)]
    ...     print(write_sensors(pair, folder + "/both.csv").read_text(), end="")
    time_s,mag1_x_nT,mag1_y_nT,mag1_z_nT,mag2_x_nT,mag2_y_nT,mag2_z_nT
    0.0,1.0,2.0,3.0,2.0,2.0,3.0
    """
    if not sensors:
        raise AgonicError("no sensors were given to write")
    first, *others = sensors
    for other in others:
        same = (first.time is None) == (other.time is None) and len(first) == len(other)
        if not same or not np.array_equal(first.time, other.time):  # type: ignore[arg-type]
            raise AgonicError(
                f"{first.name} and {other.name} have different times; write a table for each"
            )
    table: Table = {}
    for header, values in make_table(first.with_columns(name="mag")).items():
        if header == canonical_header("field", "x", first.unit):
            for number, sensor in enumerate(sensors, start=1):
                table |= _name_readings(sensor, str(number))
        elif header not in _name_readings(first):
            table[header] = values
    return write_table(table, path)


def make_table(samples: Samples) -> Table:
    """The columns of one sensor by header."""
    table: Table = {}
    for column, values in samples.columns().items():
        if column == "field":
            table |= _name_readings(samples)
        elif column in VECTORS:
            for axis, component in zip("xyz", values.T, strict=True):
                table[canonical_header(column, axis, samples.unit)] = component.tolist()
        else:
            estimated = column == "heading_deg" and samples.heading_estimated
            header = column if column in samples.disturbers else canonical_header(column)
            table["yaw_deg" if estimated else header] = values.tolist()
    if samples.epoch is not None:
        utc = samples.epoch if samples.epoch.tzinfo else samples.epoch.replace(tzinfo=UTC)
        table[canonical_header("epoch")] = [utc.timestamp()] * len(samples)
    if samples.name != "mag":
        table[canonical_header("sensor")] = [samples.name] * len(samples)
    if samples.frame != "m":
        table[canonical_header("frame")] = [samples.frame] * len(samples)
    return table


def _name_readings(samples: Samples, number: str = "") -> Table:
    """The three columns of the field, numbered where there is more than one sensor."""
    headers = (canonical_header("field", axis, samples.unit) for axis in "xyz")
    return {
        header.replace("mag_", f"mag{number}_", 1): component.tolist()
        for header, component in zip(headers, samples.field.T, strict=True)
    }


def write_table(table: Mapping[str, Sequence[object]], path: Path | str) -> Path:
    """Write columns by their headers as a text table, and return the path."""
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(table)
    writer.writerows(zip(*table.values(), strict=True))
    return write_atomically(path, stream.getvalue())


def make_parquet(table: Mapping[str, Any]) -> bytes:
    """Columns by header, numbers or texts, as the bytes of a Parquet file, compressed."""
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError:
        raise MissingExtraError("writing a Parquet file", "tables") from None
    stream = BytesIO()
    parquet.write_table(pa.table(dict(table)), stream, compression="zstd")
    return stream.getvalue()
