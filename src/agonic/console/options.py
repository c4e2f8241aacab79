"""Options that several commands share, what they mean, and those that were typed."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping
from inspect import cleandoc
from json import loads
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

_SECTION = "Options\n-------\n"
"""Below it a docstring says, a line each, what the options of a command are:

    name -o METAVAR ≥0 : what it means

with how it is written besides --name, what stands for its value, and its limits; <NAME> in place
of these is an argument."""


def split_options(text: str) -> tuple[str, str]:
    """A docstring without what it says of options, and that."""
    said, _, described = cleandoc(text).partition(_SECTION)
    return said, described


def read_options(described: str) -> dict[str, Any]:
    """The options that lines describe, by the names of the parameters."""
    made = {}
    for entry in filter(None, re.split(r"\n(?!\s)", described.strip())):
        head, _, says = " ".join(entry.split()).partition(" : ")
        name, *words = head.split()
        limits = {word[0]: loads(word[1:]) for word in words if word[0] in "≥≤"}
        written = [word for word in words if word.startswith("-")]
        if written and not any(word.startswith("--") for word in written):
            written.append(f"--{name.replace('_', '-')}")
        metavar = next((word for word in words if word[0] not in "≥≤-"), None)
        if metavar is not None and metavar.startswith("<"):
            made[name] = typer.Argument(metavar=metavar[1:-1], help=says)
        else:
            made[name] = typer.Option(
                *written, metavar=metavar, min=limits.get("≥"), max=limits.get("≤"), help=says
            )
    return made


_OF = read_options("""
log <LOG> : A recording, or - for standard input.
cal <CAL> : A calibration file written by agonic.
sensor --sensor -s : Name or number of the sensor (see agonic info).
unit --unit : Unit of the field where the log names none: nT, uT, mG, G.
json --json : One JSON object on stdout, nothing else.
at --at LAT,LON[,ALT] : Place: degrees and metres, for the world model.
date --date : Date for the world model, 2026-05-01; default: the log's, else today.
model --model NAME : World model: igrf, wmm or wmmhr; default: by the date.
altitude --altitude M : Altitude, where the log has none.
tle --tle FILE : Two-line elements that give the positions.
field --field NT : Magnitude of the field, nT, where it is known.
reference --reference X,Y,Z|FILE : The known field at each reading in the sensor's axes: columns of
  the log, or another log, a coil's or a reference magnetometer's, matched by time.
course --course : The course over ground is the heading: cars, rovers only.
between --between S,S : Only this interval, seconds by the clock of the log.
with --with NAMES : What disturbs on board: current_A, throttle, second.
scalar --scalar/--no-scalar : Against the scalar instrument, or the world model; default: as the log
  has it.
robust : Down-weight outliers with Tukey's loss.
out -o FOLDER : Folder for calibration and report, or a file .json.
report --report FILE : Report to write, .html or .txt.
table -o --out FILE : CSV file to write.
folder -o --out DIR : Folder to write to.
noise ≥0 : Noise per axis, nT.
step ≥0 : Quantisation, nT; 0 for none.
format : csv or parquet.
seed ≥0 : Seed of everything random.
""")
"""What options mean that several commands share."""

LogPath = Annotated[Path, _OF["log"]]
CalibrationPath = Annotated[Path, _OF["cal"]]
Sensor = Annotated[str | None, _OF["sensor"]]
Unit = Annotated[str | None, _OF["unit"]]
Json = Annotated[bool, _OF["json"]]
At = Annotated[str | None, _OF["at"]]
Date = Annotated[str | None, _OF["date"]]
WorldModel = Annotated[str | None, _OF["model"]]
Altitude = Annotated[float | None, _OF["altitude"]]
Elements = Annotated[Path | None, _OF["tle"]]
Magnitude = Annotated[float | None, _OF["field"]]
KnownField = Annotated[str | None, _OF["reference"]]
Course = Annotated[bool, _OF["course"]]
Between = Annotated[str | None, _OF["between"]]
Sources = Annotated[str | None, _OF["with"]]
Scalar = Annotated[bool | None, _OF["scalar"]]
Robust = Annotated[bool, _OF["robust"]]
Out = Annotated[Path | None, _OF["out"]]
Report = Annotated[Path | None, _OF["report"]]
Table = Annotated[Path, _OF["table"]]
Folder = Annotated[Path, _OF["folder"]]
Readings = Annotated[int, typer.Option("-n", help="Readings.", min=1)]
Noise = Annotated[float, _OF["noise"]]
Step = Annotated[float, _OF["step"]]
Format = Annotated[str, _OF["format"]]
Seed = Annotated[int, _OF["seed"]]
Mounting = Annotated[
    str | None,
    typer.Option(
        "--mounting",
        metavar='"x up, y forward"',
        help="Where the sensor's axes point in the vehicle: readings are turned into body axes.",
    ),
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
