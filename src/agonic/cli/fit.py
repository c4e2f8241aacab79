"""`agonic fit KIND LOG`: one fit with every setting."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.cli.options import At, Date, Json, LogPath, Magnitude, Sensor, Unit, log_and_sensors
from agonic.errors import AgonicError


def add_to(app: typer.Typer) -> None:
    """Register the command and its kinds."""
    kinds = typer.Typer(help="Fit one kind of calibration to a log.", no_args_is_help=True)
    kinds.command("ellipsoid")(ellipsoid)
    app.add_typer(kinds, name="fit", rich_help_panel=None)


def ellipsoid(
    log: LogPath,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="CAL", help="Calibration file to write.")
    ] = None,
    sensor: Sensor = None,
    unit: Unit = None,
    at: At = None,
    date: Date = None,
    field: Magnitude = None,
    model: Annotated[str, typer.Option(help="auto, sphere, diagonal or full.")] = "auto",
    method: Annotated[
        str, typer.Option(help="likelihood, adjusted, li-griffiths or linear.")
    ] = "likelihood",
    gauge: Annotated[str, typer.Option(help="symmetric, or triangular.")] = "symmetric",
    robust: Annotated[bool, typer.Option(help="Meet outliers with Tukey's loss.")] = True,
    soft_iron_sd: Annotated[
        float, typer.Option(help="Prior on soft iron, standard deviation; 0 for none.")
    ] = 0.1,
    as_json: Json = False,
) -> int:
    """Bias and matrix from the magnitude alone."""
    from agonic.calibrated import calibrate
    from agonic.cli.output import print_json, say
    from agonic.cli.place import expected
    from agonic.io.calfile import save
    from agonic.report.record import record
    from agonic.report.text import summary

    _, sensors = log_and_sensors(log, sensor, unit)
    if len(sensors) > 1:
        names = ", ".join(samples.name for samples in sensors)
        raise AgonicError(f"the log holds {names}; choose one with --sensor")
    reference, settings = expected(sensors[0], at, date, field)
    result = calibrate(
        sensors[0], reference, model=model, method=method, gauge=gauge, robust=robust,
        soft_iron_sd=soft_iron_sd or None, **settings,
    )  # fmt: skip
    files = [str(save(result.fit.calibration, out))] if out and result.verdict != "refused" else []
    if as_json:
        print_json("agonic/fit@1", record(result, files))
    else:
        say(summary([result]))
        say(f"\nWritten   {files[0]}" if files else "\nNothing was written.")
    return 0 if result.verdict == "good" else 1
