"""`agonic plan alignment`: the orientations of a session with a star sensor."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.console.options import Date, Json
from agonic.console.parse import parse_names, parse_position

Solve = Annotated[
    str, typer.Option(metavar="LIST", help="Besides the alignment: reference, pier, bias, matrix.")
]
Wanted = Annotated[
    float, typer.Option(metavar="ARCSEC", help="Standard error wanted about every axis.")
]


def alignment(
    at: Annotated[
        str, typer.Option("--at", metavar="LAT,LON[,ALT]", help="The observatory, degrees.")
    ],
    wanted: Wanted = 1.0,
    solve: Solve = "alignment",
    readings: Annotated[int, typer.Option(help="Readings per orientation.")] = 20,
    noise: Annotated[float, typer.Option(metavar="NT", help="Noise of the magnetometer.")] = 0.5,
    reference_noise: Annotated[float, typer.Option(metavar="NT", help="Reference noise.")] = 0.3,
    across: Annotated[
        float, typer.Option(metavar="ARCSEC", help="Star sensor noise across its boresight.")
    ] = 3.0,
    about: Annotated[float, typer.Option(metavar="ARCSEC", help="About its boresight.")] = 20.0,
    pier_sd: Annotated[
        float | None, typer.Option(metavar="NT", help="Error of the pier difference.")
    ] = None,
    axes_sd: Annotated[
        float | None, typer.Option(metavar="ARCSEC", help="Error of the reference's axes.")
    ] = None,
    lowest: Annotated[
        float, typer.Option(metavar="DEG", help="Lowest elevation for the star sensor.")
    ] = 40.0,
    date: Date = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="FILE", help="Plan: .html or .txt.")
    ] = None,
    as_json: Json = False,
) -> int:
    """Orientations for a wanted standard error, and the errors to expect."""
    from agonic.alignment.star_sensor import plan_alignment
    from agonic.alignment.star_sensor.plan_document import describe_plan
    from agonic.console.finish import finish

    plan = plan_alignment(
        _field(at, date),
        wanted_sd_arcsec=wanted,
        readings=readings,
        noise=noise,
        solve=parse_names(solve),
        reference_noise=reference_noise,
        across_sd_arcsec=across,
        about_sd_arcsec=about,
        pier_sd=pier_sd,
        reference_sd_arcsec=axes_sd,
        lowest_elevation_deg=lowest,
    )
    return finish(describe_plan(plan), report=out, option="-o", as_json=as_json)


def _field(at: str, date: str | None) -> list[float]:
    """The field at the observatory by the world model, north, east, down, nT."""
    from datetime import UTC, datetime

    from agonic.field import wmm

    when = date or datetime.now(UTC).date().isoformat()
    field = wmm().at(*parse_position(at), when)
    return [float(field.north), float(field.east), float(field.down)]
