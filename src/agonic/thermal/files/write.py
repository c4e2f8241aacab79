"""`write_campaign`: a folder with a table a station, and `write_description`: its campaign.toml."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from agonic.arrays import Array
from agonic.atomic import make_folder, write_atomically
from agonic.errors import AgonicError, check_choice
from agonic.exports.csv import make_parquet
from agonic.files.toml_sections import write_value
from agonic.maths.rotations.attitude import angles_deg
from agonic.samples import Samples
from agonic.thermal.campaign.description import Description
from agonic.thermal.files.schema import FILE_NAME

Format = Literal["csv", "parquet"]

_DECIMALS = {"time": 3, "field": 4, "temperature": 3}
"""Of seconds, µT and °C: a tenth of a nanotesla."""


def write_campaign(
    description: Description,
    stations: Iterable[tuple[int, Mapping[str, Samples]]],
    folder: Path | str,
    *,
    format: Format = "csv",
) -> list[Path]:
    """Write the recordings of stations, one at a time, and what they are about.

    Parameters
    ----------
    description : what goes into campaign.toml; the columns of its sensors are named here.
    stations : the number of each and its samples by sensor, at the same moments; in nT.
    folder : made where it is not there. format : "csv" or "parquet".

    Returns the paths, that of campaign.toml last. Raises `AgonicError` where a file cannot be
    written.

    >>> from tempfile import TemporaryDirectory
    >>> from agonic.thermal.campaign.description import Sensor
    >>> described = Description(sensors=(Sensor(name="board"),))
    >>> samples = Samples(time=[0.0, 1.0], field=np.ones((2, 3)), temperature=[20.0, 21.0])
    >>> with TemporaryDirectory() as folder:
    ...     files = write_campaign(described, [(1, {"board": samples})], folder)
    ...     print(files[0].name, files[0].read_text().splitlines()[1])
    station-01.csv 0,0.001,0.001,0.001,20
    """
    check_choice("format", format, get_args(Format))
    home = make_folder(folder)
    sensors = tuple(
        replace(sensor, column=f"mag{k}") for k, sensor in enumerate(description.sensors, start=1)
    )
    pattern = f"station-{{station:02d}}.{format}"
    files = []
    for number, recorded in stations:
        table = _make_table([recorded[sensor.name] for sensor in sensors])
        made = make_parquet(table) if format == "parquet" else _format_csv(table)
        files.append(write_atomically(home / pattern.format(station=number), made))
    named = replace(description, sensors=sensors, files=pattern)
    return [*files, write_description(named, home / FILE_NAME)]


def _make_table(sensors: list[Samples]) -> dict[str, Array]:
    """The columns of sensors that were read at the same moments, in µT."""
    first = sensors[0]
    table: dict[str, Array] = {}
    if first.time is not None:
        table["time_s"] = first.time.round(_DECIMALS["time"])
    for k, samples in enumerate(sensors, start=1):
        if len(samples) != len(first):
            raise AgonicError(f"{samples.name} has not as many rows as {first.name}")
        for axis, values in zip("xyz", samples.field.T, strict=True):
            table[f"mag{k}_{axis}_uT"] = (values * 1e-3).round(_DECIMALS["field"])
        if samples.temperature is not None:
            table[f"temperature{k}_C"] = samples.temperature.round(_DECIMALS["temperature"])
    return table


def _format_csv(table: Mapping[str, Array]) -> bytes:
    """Comma-separated text; by pyarrow where it is installed, ten times faster."""
    stream = BytesIO()
    try:
        import pyarrow as pa
        from pyarrow import csv
    except ImportError:
        stream.write((",".join(table) + "\n").encode())
        np.savetxt(stream, np.stack(list(table.values()), axis=1), fmt="%.10g", delimiter=",")
        return stream.getvalue()
    stream.write((",".join(table) + "\n").encode())
    options = csv.WriteOptions(include_header=False)
    csv.write_csv(pa.table(dict(table)), stream, write_options=options)
    return stream.getvalue()


def write_description(description: Description, path: Path | str) -> Path:
    """Write a campaign.toml that `read_description` reads back, and return its path."""
    lines = _format_pairs(
        name=description.name,
        files=description.files,
        unit=description.unit,
        rate_Hz=description.rate_Hz,
        fixture_sd_deg=description.fixture_sd_deg,
        columns=description.columns,
    )
    for sensor in description.sensors:
        given = {"noise_nT" if k == "noise" else k: v for k, v in vars(sensor).items()}
        lines += ["", "[[sensor]]", *_format_pairs(**given)]
    for station in description.stations:
        angles = {}
        if station.rot_nb is not None:
            made = (round(float(a), 4) + 0.0 for a in angles_deg(station.rot_nb.as_matrix()))
            angles = dict(zip(("roll_deg", "pitch_deg", "heading_deg"), made, strict=True))
        given = {"number": station.number, "file": station.file, "pose": station.pose, **angles}
        lines += ["", "[[station]]", *_format_pairs(**given)]
    if description.profile is not None:
        lines += ["", "[profile]", *_format_pairs(**vars(description.profile))]
    field = _format_pairs(
        magnitude_nT=description.magnitude, inclination_deg=description.inclination_deg
    )
    lines += ["", "[field]", *field] if field else []
    return write_atomically(path, "\n".join(lines).lstrip() + "\n")


def _format_pairs(**values: Any) -> list[str]:
    """The keys that have something to say."""
    return [
        f"{key} = {_format_value(value)}"
        for key, value in values.items()
        if value not in (None, "", {})
    ]


def _format_value(value: Any) -> str:
    if isinstance(value, Mapping):
        pairs = (f"{write_value(key)} = {write_value(text)}" for key, text in value.items())
        return f"{{ {', '.join(pairs)} }}"
    return write_value(value) if isinstance(value, str) else repr(value)
