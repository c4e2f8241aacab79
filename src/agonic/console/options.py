"""Options that several commands share, what they mean, and those that were typed."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

LogPath = Annotated[
    Path, typer.Argument(metavar="LOG", help="A recording, or - for standard input.")
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
    typer.Option(
        "--date", help="Date for the world model, 2026-05-01; default: the log's, else today."
    ),
]
WorldModel = Annotated[
    str | None,
    typer.Option(
        "--model", metavar="NAME", help="World model: igrf, wmm or wmmhr; default: by the date."
    ),
]
Altitude = Annotated[
    float | None,
    typer.Option("--altitude", metavar="M", help="Altitude, where the log has none."),
]
Elements = Annotated[
    Path | None,
    typer.Option("--tle", metavar="FILE", help="Two-line elements that give the positions."),
]
Magnitude = Annotated[
    float | None,
    typer.Option("--field", metavar="NT", help="Magnitude of the field, nT, where it is known."),
]


SCALAR_SD_NT = 0.5
"""Absolute accuracy in the data sheets of proton and Overhauser magnetometers: 0.2 to 1 nT."""


class ScalarChoice(NamedTuple):
    """Options that name a scalar magnetometer beside the sensor.

    Options
    -------
    column --scalar COLUMN|FILE : A scalar magnetometer beside the sensor: its column in the log, a
        table of its own (FILE or FILE:COLUMN), or none; default: scalar_nT of the log, if nothing
        else is known.
    sd --scalar-sd NT ≥0 : How far the scalar instrument may be off.
    """

    column: str | None = None
    sd: float = SCALAR_SD_NT


class SensorChoice(NamedTuple):
    """Options that choose a sensor of a log, and say what its readings are in."""

    sensor: Sensor = None
    unit: Unit = None


class Place(NamedTuple):
    """Options that say what the field should have been: where and when, or how large."""

    at: At = None
    date: Date = None
    field: Magnitude = None


KnownField = Annotated[
    str | None,
    typer.Option(
        "--reference",
        metavar="X,Y,Z|FILE",
        help="The known field at each reading in the sensor's axes: columns of the log, or another "
        "log, a coil's or a reference magnetometer's, matched by time.",
    ),
]
Course = Annotated[
    bool, typer.Option("--course", help="The course over ground is the heading: cars, rovers only.")
]
Between = Annotated[
    str | None,
    typer.Option(
        "--between", metavar="S,S", help="Only this interval, seconds by the clock of the log."
    ),
]
Sources = Annotated[
    str | None,
    typer.Option(
        "--with", metavar="NAMES", help="What disturbs on board: current_A, throttle, second."
    ),
]
Scalar = Annotated[
    bool | None,
    typer.Option(
        "--scalar/--no-scalar",
        help="Against the scalar instrument, or the world model; default: as the log has it.",
    ),
]
Robust = Annotated[bool, typer.Option(help="Down-weight outliers with Tukey's loss.")]
Mounting = Annotated[
    str | None,
    typer.Option(
        "--mounting",
        metavar='"x up, y forward"',
        help="Where the sensor's axes point in the vehicle: readings are turned into body axes.",
    ),
]
Out = Annotated[
    Path | None,
    typer.Option(
        "-o", "--out", metavar="FOLDER", help="Folder for calibration and report, or a file .json."
    ),
]
Report = Annotated[
    Path | None, typer.Option("--report", metavar="FILE", help="Report to write, .html or .txt.")
]


Table = Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="CSV file to write.")]
Folder = Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Folder to write to.")]
Readings = Annotated[int, typer.Option("-n", help="Readings.", min=1)]
Noise = Annotated[float, typer.Option(help="Noise per axis, nT.", min=0)]
Step = Annotated[float, typer.Option(help="Quantisation, nT; 0 for none.", min=0)]
Format = Annotated[str, typer.Option(help="csv or parquet.")]
Seed = Annotated[int, typer.Option(help="Seed of everything random.", min=0)]


NOT_OF_THE_RESULT = ("--json", "--open", "--verbose", "--force", "--store", "--as")
"""Options that say how a result is shown or kept, and that another run need not repeat."""


def list_typed_options(context: typer.Context) -> dict[str, str]:
    """The options that were typed for a command with their values, "" for a flag."""
    from agonic.logs.headers.column_names import write_given_names

    typed = {}
    for param in context.command.params:
        name = param.name or ""
        source = context.get_parameter_source(name)
        if param.param_type_name != "option" or source is None or source.name != "COMMANDLINE":
            continue
        value = context.params[name] if name in context.params else write_given_names()
        flag = "-o" if "-o" in param.opts else max(param.opts, key=len)
        if flag not in NOT_OF_THE_RESULT:
            typed[flag] = "" if value is True else str(value)
    return typed


def write_options(options: Mapping[str, str]) -> str:
    """Options as one types them, each with the blank before it."""
    return "".join(
        f" {name}" + (f" {shlex.quote(value)}" if value else "") for name, value in options.items()
    )
