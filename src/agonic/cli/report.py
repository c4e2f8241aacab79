"""`agonic report CAL [LOG]`: the page for a calibration file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.cli.options import At, CalibrationPath, Date, Json, Magnitude, Sensor, Unit
from agonic.errors import AgonicError


def add_to(app: typer.Typer) -> None:
    """Register the command."""
    app.command("report")(report)


def report(
    cal: CalibrationPath,
    log: Annotated[
        Path | None,
        typer.Argument(metavar="[LOG]", help="Readings; default: the log it was made from."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="HTML", help="Page; default beside CAL.")
    ] = None,
    sensor: Sensor = None,
    unit: Unit = None,
    at: At = None,
    date: Date = None,
    field: Magnitude = None,
    as_json: Json = False,
) -> int:
    """Show what a calibration does to a log: spheres, residuals, checks, provenance."""
    from agonic.calibrated import judge
    from agonic.cli.output import print_json, say
    from agonic.cli.pair import calibration_and_samples
    from agonic.cli.place import expected
    from agonic.io.atomic import write_atomically
    from agonic.report.html import render
    from agonic.report.record import record

    calibration, samples = calibration_and_samples(cal, log or own_log(cal), sensor, unit)
    reference, settings = expected(samples, at, date, field)
    result = judge(calibration, samples, reference, **settings)
    path = write_atomically(
        out or cal.with_suffix(".html"), render([result], title=f"{cal.name} on {samples.name}")
    )
    if as_json:
        print_json("agonic/report@1", record(result, [str(path)]))
    else:
        say(f"Report    {path}")
    return 0 if result.verdict == "good" else 1


def own_log(cal: Path) -> Path:
    """The log that a calibration was made from, where it still lies nearby unchanged."""
    from agonic.io.calfile import load
    from agonic.provenance import sha256_of

    inputs = load(cal).provenance.inputs
    for given in inputs:
        for folder in (cal.parent, cal.parent.parent, Path()):
            path = folder / given.name
            if path.is_file() and sha256_of(path) == given.sha256:
                return path
    names = ", ".join(given.name for given in inputs) or "its log"
    raise AgonicError(f"{names} is not beside {cal}; name the log: agonic report {cal} LOG")
