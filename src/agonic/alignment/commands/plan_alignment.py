"""`agonic plan alignment`: the orientations of a session with a star sensor."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from agonic.console.options import Date, Json

if TYPE_CHECKING:
    from agonic.alignment.star_sensor import AlignmentPlan


def add_to(kinds: typer.Typer) -> None:
    """Register the kind of plan."""
    kinds.command("alignment")(alignment)


def alignment(
    at: Annotated[
        str, typer.Option("--at", metavar="LAT,LON[,ALT]", help="The observatory, degrees.")
    ],
    wanted: Annotated[
        float, typer.Option(metavar="ARCSEC", help="Standard error wanted about every axis.")
    ] = 1.0,
    solve: Annotated[
        str,
        typer.Option(metavar="LIST", help="Besides the alignment: reference, pier, bias, matrix."),
    ] = "alignment",
    readings: Annotated[int, typer.Option(help="Of each instrument in each orientation.")] = 20,
    noise: Annotated[float, typer.Option(metavar="NT", help="Of the magnetometer.")] = 0.5,
    reference_noise: Annotated[float, typer.Option(metavar="NT", help="Of the reference.")] = 0.3,
    across: Annotated[
        float, typer.Option(metavar="ARCSEC", help="Of the star sensor, across its boresight.")
    ] = 3.0,
    about: Annotated[float, typer.Option(metavar="ARCSEC", help="About its boresight.")] = 20.0,
    pier_sd: Annotated[
        float | None, typer.Option(metavar="NT", help="How well the pier difference is known.")
    ] = None,
    axes_sd: Annotated[
        float | None, typer.Option(metavar="ARCSEC", help="The same of the reference's axes.")
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
    """Orientations for a wanted standard error, and what they will tell."""
    from agonic.alignment.report.alignment_text import plan_text
    from agonic.alignment.star_sensor import plan_alignment
    from agonic.console.output import print_json, say

    plan = plan_alignment(
        _field(at, date),
        wanted_sd_arcsec=wanted,
        readings=readings,
        noise=noise,
        solve=tuple(name.strip() for name in solve.split(",") if name.strip()),
        reference_noise=reference_noise,
        across_sd_arcsec=across,
        about_sd_arcsec=about,
        pier_sd=pier_sd,
        reference_sd_arcsec=axes_sd,
        lowest_elevation_deg=lowest,
    )
    files = _written(plan, out)
    if as_json:
        print_json(
            "agonic/plan-alignment@1",
            {
                "orientations": [
                    {"azimuth_deg": a, "elevation_deg": e, "roll_deg": r}
                    for a, e, r in plan.orientations
                ],
                "readings": plan.readings,
                "solve": plan.solve,
                "field_n_nT": plan.field_n,
                "sd_arcsec": plan.sd_arcsec,
                "worst_sd_arcsec": plan.worst_sd_arcsec,
                "sd": plan.sd,
                "files": files,
            },
        )
        return 0
    say(plan_text(plan))
    if files:
        say(f"\nWritten   {', '.join(files)}")
    return 0


def _field(at: str, date: str | None) -> list[float]:
    """The field at the observatory by the world model, north, east, down, nT."""
    from datetime import UTC, datetime

    from agonic.console.place import position
    from agonic.field import wmm

    when = date or datetime.now(UTC).date().isoformat()
    field = wmm().at(*position(at), when)
    return [float(field.north), float(field.east), float(field.down)]


def _written(plan: AlignmentPlan, out: Path | None) -> list[str]:
    """The plan in the form that its name asks for."""
    from agonic.alignment.report.alignment_page import plan_page
    from agonic.alignment.report.alignment_text import plan_text
    from agonic.console.printed_page import written_as_named

    return written_as_named(out, "-o", page=lambda: plan_page(plan), text=lambda: plan_text(plan))
