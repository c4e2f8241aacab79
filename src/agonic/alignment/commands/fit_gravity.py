"""`agonic fit gravity LOG -o CAL`: how a magnetometer sits on an accelerometer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.alignment.commands.options import Out
from agonic.console.options import Between, Json, LogPath, Sensor, Unit, log_and_sensors


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
    from agonic.calibration.chain import require_calibration
    from agonic.console.finish import finish
    from agonic.errors import AgonicError
    from agonic.files.calibration import load

    _, sensors = log_and_sensors(log, sensor, unit, between)
    if len(sensors) > 1:
        names = ", ".join(samples.name for samples in sensors)
        raise AgonicError(f"the log holds {names}; choose one with --sensor")
    known = None if calibration is None else require_calibration(load(calibration))
    fit = fit_gravity(sensors[0], known, bias=bias)
    return finish(describe_gravity(fit, sensors[0].name), out=out, as_json=as_json)
