"""Samples as a text table under the canonical names, which `read` reads back to the last digit."""

from __future__ import annotations

import csv
from datetime import UTC
from io import StringIO
from pathlib import Path

from agonic.io.atomic import write_atomically
from agonic.io.columns import canonical_header
from agonic.samples import VECTORS, Samples


def write_csv(samples: Samples, path: Path | str) -> Path:
    """Write the columns of the samples, a row a sample, and return the path.

    Headers are `time_s, mag_x_nT, mag_y_nT, mag_z_nT, temperature_C, …` (`mag_x_raw` where the
    unit is not known). The epoch, the name of the sensor and the letter of its axes, which belong
    to the whole table, are columns at the end, where they are not unknown, "mag" and "m". Notes
    and the correction that a log had applied (`logged`) are not written.

    Raises `AgonicError` where the file cannot be written.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     samples = Samples(time=[0.0, 0.1], field=[[1.5, 2.0, 3.0], [4.0, 5.0, 6.0]])
    ...     print(write_csv(samples, folder + "/samples.csv").read_text(), end="")
    time_s,mag_x_nT,mag_y_nT,mag_z_nT
    0.0,1.5,2.0,3.0
    0.1,4.0,5.0,6.0
    """
    table: dict[str, list[float] | list[str]] = {}
    for column, values in samples.columns().items():
        if column in VECTORS:
            for axis, component in zip("xyz", values.T, strict=True):
                table[canonical_header(column, axis, samples.unit)] = component.tolist()
        else:
            table[canonical_header(column)] = values.tolist()
    if samples.epoch is not None:
        utc = samples.epoch if samples.epoch.tzinfo else samples.epoch.replace(tzinfo=UTC)
        table[canonical_header("epoch")] = [utc.timestamp()] * len(samples)
    if samples.name != "mag":
        table[canonical_header("sensor")] = [samples.name] * len(samples)
    if samples.frame != "m":
        table[canonical_header("frame")] = [samples.frame] * len(samples)
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(table)
    writer.writerows(zip(*table.values(), strict=True))
    return write_atomically(path, stream.getvalue())
