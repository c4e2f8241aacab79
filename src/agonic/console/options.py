"""Options that several commands share, and what they mean."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from agonic.logs.log import Log
    from agonic.samples import Samples

LogPath = Annotated[
    Path, typer.Argument(metavar="LOG", help="A recording; its content decides how it is read.")
]
CalibrationPath = Annotated[
    Path, typer.Argument(metavar="CAL", help="A calibration file written by agonic.")
]
Sensor = Annotated[
    str | None,
    typer.Option("--sensor", "-s", help="Name or number of the sensor (see agonic info)."),
]
Unit = Annotated[
    str | None,
    typer.Option("--unit", help="Unit of the field where the log names none: nT, uT, mG, G."),
]
Json = Annotated[bool, typer.Option("--json", help="One JSON object on stdout, nothing else.")]
At = Annotated[
    str | None,
    typer.Option(
        "--at", metavar="LAT,LON[,ALT]", help="Place: degrees and metres, for the world model."
    ),
]
Date = Annotated[
    str | None,
    typer.Option("--date", help="Date for the world model, 2026-05-01; default: the log's own."),
]
Magnitude = Annotated[
    float | None,
    typer.Option("--field", metavar="NT", help="Magnitude of the field, nT, where it is known."),
]


Between = Annotated[
    str | None,
    typer.Option(
        "--between", metavar="S,S", help="Only this stretch, seconds since the first reading."
    ),
]


def log_and_sensors(
    path: Path, sensor: str | None, unit: str | None, between: str | None = None
) -> tuple[Log, tuple[Samples, ...]]:
    """A log, and the sensor that was asked for or all of them, whole or a stretch of it."""
    from agonic.logs.read import open_log

    log = open_log(path, unit=unit)
    sensors = log.sensors if sensor is None else (log.sensor(sensor),)
    return log, tuple(stretch(samples, between) for samples in sensors)


def stretch(samples: Samples, between: str | None) -> Samples:
    """The readings between two moments of "START,STOP", seconds since the first reading."""
    from agonic.errors import AgonicError

    if between is None:
        return samples
    try:
        start, stop = (float(part) for part in between.split(","))
    except ValueError:
        raise AgonicError(f"--between {between!r} is not START,STOP in seconds") from None
    if samples.time is None:
        raise AgonicError(f"--between needs times and {samples.name} was logged without")
    since = samples.time - samples.time[0]
    rows = (since >= start) & (since <= stop)
    if not rows.any():
        raise AgonicError(
            f"--between {between} holds no reading of {samples.name}, which lasts {since[-1]:.1f} s"
        )
    return samples.select(rows)
