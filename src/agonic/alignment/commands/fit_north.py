"""`agonic fit north SESSION|SHEET`: true north, azimuths, and absolute measurements."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from agonic.console.options import (
    Json,
    Magnitude,
    Out,
    Report,
)

if TYPE_CHECKING:
    from agonic.report.document import Document


def add_to(kinds: typer.Typer) -> None:
    """Register the kind of fit."""
    kinds.command("north")(north)


def north(
    session: Annotated[
        Path,
        typer.Argument(metavar="SESSION", help="north.toml or its folder; or a DI-flux sheet."),
    ],
    out: Out = None,
    report: Report = None,
    field: Magnitude = None,
    as_json: Json = False,
) -> int:
    """True north by a gyrotheodolite, carried on; or declination and inclination of a sheet."""
    from agonic.alignment.files.read_di_flux import is_di_flux
    from agonic.console.finish import finish
    from agonic.errors import AgonicError

    if session.is_file() and is_di_flux(session):
        if out is not None:
            raise AgonicError("a DI-flux sheet gives no calibration; leave -o out")
        return finish(_of_sheet(session, field), report=report, as_json=as_json)
    if field is not None:
        raise AgonicError("--field belongs to DI-flux sheets; a gyrotheodolite needs none")
    return finish(_of_gyro(session, out), out=out, report=report, as_json=as_json)


def _of_gyro(session: Path, out: Path | None) -> Document:
    from agonic.alignment.files.read_north import read_north
    from agonic.alignment.north import fit_north
    from agonic.alignment.north.document import describe_north
    from agonic.errors import AgonicError

    fit = fit_north(read_north(session))
    if out is not None and fit.calibration is None:
        raise AgonicError("-o needs an alignment: give [platform], [magnetometer] and [reference]")
    return describe_north(fit)


def _of_sheet(sheet: Path, field: float | None) -> Document:
    from agonic.alignment.files.read_di_flux import read_di_flux
    from agonic.alignment.north import fit_di_flux
    from agonic.alignment.north.di_flux_document import describe_di_flux

    return describe_di_flux(fit_di_flux(read_di_flux(sheet), magnitude=field))
