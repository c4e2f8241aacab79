"""`agonic export CAL --to TARGET`: a calibration for where it flies."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.cli.options import CalibrationPath, Json


def add_to(app: typer.Typer) -> None:
    """Register the command."""
    app.command("export")(export)


def export(
    cal: CalibrationPath,
    to: Annotated[
        str,
        typer.Option("--to", help="ardupilot, px4, c, motioncal, matlab, ros or table."),
    ],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="FILE", help="File; default beside CAL.")
    ] = None,
    number: Annotated[
        int | None,
        typer.Option(
            help="Which compass of the vehicle, from 1; default: by the sensor's name.",
            min=1,
            max=4,
        ),
    ] = None,
    device_id: Annotated[
        int | None, typer.Option(help="PX4 device id; default: the calibration's own.")
    ] = None,
    as_json: Json = False,
) -> int:
    """Write a calibration in another program's own form, with what that form cannot hold."""
    from agonic.cli.output import print_json, say
    from agonic.io.calfile import load
    from agonic.io.targets import SUFFIXES
    from agonic.io.targets import write as write_target

    path = out or cal.with_suffix(SUFFIXES.get(to, ""))
    written = write_target(to, load(cal), path, number=number, device_id=device_id)
    if as_json:
        print_json(
            "agonic/export@1",
            {"target": to, "files": [str(written.path)], "warnings": written.warnings},
        )
    else:
        say(f"Written   {written.path}")
        for warning in written.warnings:
            say(f"Warning   {warning}")
    return 0
