"""`agonic fit alignment SESSION -o CAL`: how a magnetometer sits on a star sensor."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.alignment.commands.options import Solve, Wanted
from agonic.console.options import (
    Json,
    Out,
    Report,
)
from agonic.console.parse import parse_names


def add_to(kinds: typer.Typer) -> None:
    """Register the kind of fit."""
    kinds.command("alignment")(alignment)


def alignment(
    session: Annotated[
        Path, typer.Argument(metavar="SESSION", help="session.toml, or the folder it is in.")
    ],
    out: Out = None,
    solve: Solve = "alignment",
    wanted: Wanted = 2.0,
    report: Report = None,
    as_json: Json = False,
) -> int:
    """The rotation between star sensor and magnetometer, from a session of many orientations."""
    from agonic.alignment.files.read_session import read_session
    from agonic.alignment.star_sensor import fit_alignment
    from agonic.alignment.star_sensor.document import describe_alignment
    from agonic.console.finish import finish

    groups = parse_names(solve)
    fit = fit_alignment(read_session(session), solve=groups, wanted_sd_arcsec=wanted)
    return finish(describe_alignment(fit), out=out, report=report, as_json=as_json)
