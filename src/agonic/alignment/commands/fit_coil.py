"""`agonic fit coil SESSION`: the magnetic axis and the constant of a coil."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.console.options import (
    Json,
    Report,
)


def add_to(kinds: typer.Typer) -> None:
    """Register the kind of fit."""
    kinds.command("coil")(coil)


def coil(
    session: Annotated[
        Path, typer.Argument(metavar="SESSION", help="coil.toml, or the folder it is in.")
    ],
    report: Report = None,
    as_json: Json = False,
) -> int:
    """The axis of a coil in every known frame, its constant and linearity, from reversals."""
    from agonic.alignment.coil import fit_coil
    from agonic.alignment.coil.document import describe_coil
    from agonic.alignment.files.read_coil import read_coil
    from agonic.console.finish import finish

    return finish(describe_coil(fit_coil(read_coil(session))), report=report, as_json=as_json)
