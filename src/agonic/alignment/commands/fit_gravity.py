"""`agonic fit gravity LOG -o CAL`: how a magnetometer sits on an accelerometer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.console.options import (
    Between,
    Json,
    LogPath,
    Out,
    Sensor,
    Unit,
)
from agonic.console.sensors import open_sensor


def add_to(kinds: typer.Typer) -> None:
    """Register the kind of fit."""
    kinds.command("gravity")(gravity)


def gravity(
    log: LogPath,
    out: Out = None,
    sensor: Sensor = None,
    unit: Unit = None,
    calibration: Annotated[
        Path | None,
        typer.Option("--calibration", metavar="CAL", help="Of the magnetometer, applied first."),
    ] = None,
    bias: Annotated[bool, typer.Option("--bias", help="Seek the magnetometer's bias too.")] = False,
    between: Between = None,
    as_json: Json = False,
) -> int:
    """The rotation from magnetometer to accelerometer, from orientations at rest."""
    from agonic.alignment.gravity import fit_gravity
    from agonic.alignment.gravity.document import describe_gravity
    from agonic.calibration.steps import require_calibration
    from agonic.console.finish import finish
    from agonic.files.calibration import load

    samples = open_sensor(log, sensor, unit, between)
    known = None if calibration is None else require_calibration(load(calibration))
    fit = fit_gravity(samples, known, bias=bias)
    return finish(describe_gravity(fit, samples.name), out=out, as_json=as_json)
