"""`agonic fit coil SESSION`: the magnetic axis and the constant of a coil."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.alignment.commands.fit_north import Report, reported
from agonic.console.options import Json

if TYPE_CHECKING:
    from agonic.alignment.coil import CoilFit


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
    from agonic.alignment.files.read_coil import read_coil
    from agonic.alignment.report.coil_page import coil_page
    from agonic.alignment.report.north_text import coil_text
    from agonic.console.output import print_json, say

    fit = fit_coil(read_coil(session))
    files = reported(report, lambda: coil_text(fit), lambda: coil_page(fit))
    if as_json:
        print_json("agonic/fit-coil@1", {**record(fit), "files": files})
    else:
        say(coil_text(fit))
        if files:
            say(f"\nWritten   {', '.join(files)}")
    return 0 if fit.verdict == "good" else 1


def record(fit: CoilFit) -> dict[str, Any]:
    """The fit as one object for programs."""
    from dataclasses import asdict

    return {
        "coil": fit.session.coil,
        "verdict": fit.verdict,
        "status": fit.status,
        "n": fit.n,
        "reversals": fit.reversals,
        "constant_nT_A": fit.constant,
        "constant_sd_nT_A": fit.constant_sd,
        "axes": {
            letter: {
                "axis": direction.axis,
                "sd_arcsec": direction.sd_arcsec,
                "covariance": direction.covariance,
            }
            for letter, direction in fit.directions.items()
        },
        "unix_s": fit.time,
        "geometric_deg": fit.geometric_deg,
        "geometric_sd_arcsec": fit.geometric_sd_arcsec,
        "levels": [asdict(level) for level in fit.levels],
        "p_linear": fit.p_linear,
        "even_nT_A2": fit.estimate.even,
        "noise_nT": fit.estimate.noise,
        "findings": [asdict(finding) for finding in fit.findings],
    }
