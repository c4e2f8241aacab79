"""`agonic plan alignment`: the orientations of a session with a star sensor."""

from __future__ import annotations

from datetime import UTC, datetime
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
    at: str,
    wanted: Wanted = 1.0,
    solve: Solve = "alignment",
    readings: int = 20,
    noise: float = 0.5,
    reference_noise: float = 0.3,
    across: float = 3.0,
    about: float = 20.0,
    pier_sd: float | None = None,
    axes_sd: float | None = None,
    lowest: float = 40.0,
    date: Date = None,
    out: Path | None = None,
    as_json: Json = False,
) -> int:
    """Orientations for a wanted standard error, and the errors to expect.

    Options
    -------
    at LAT,LON[,ALT] : The observatory, degrees.
    readings : Readings per orientation.
    noise NT : Noise of the magnetometer.
    reference_noise NT : Reference noise.
    across ARCSEC : Star sensor noise across its boresight.
    about ARCSEC : About its boresight.
    pier_sd NT : Error of the pier difference.
    axes_sd ARCSEC : Error of the reference's axes.
    lowest DEG : Lowest elevation for the star sensor.
    out -o FILE : Plan: .html or .txt.
    """
    from agonic.alignment.star_sensor.document import describe_plan
    from agonic.alignment.star_sensor.plan import plan_alignment
    from agonic.console.finish import finish
    from agonic.field import wmm

    when = date or datetime.now(UTC).date().isoformat()
    field = wmm().at(*parse_position(at), when)
    plan = plan_alignment(
        [float(field.north), float(field.east), float(field.down)],
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
