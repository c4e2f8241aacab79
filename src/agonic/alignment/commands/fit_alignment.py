"""`agonic fit alignment SESSION -o CAL`: how a magnetometer sits on a star sensor."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.console.options import Json

if TYPE_CHECKING:
    from agonic.alignment.star_sensor import AlignmentFit


def add_to(kinds: typer.Typer) -> None:
    """Register the kind of fit."""
    kinds.command("alignment")(alignment)


def alignment(
    session: Annotated[
        Path, typer.Argument(metavar="SESSION", help="session.toml, or the folder it is in.")
    ],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="CAL", help="Calibration file to write.")
    ] = None,
    solve: Annotated[
        str,
        typer.Option(metavar="LIST", help="Besides the alignment: reference, pier, bias, matrix."),
    ] = "alignment",
    wanted: Annotated[
        float, typer.Option(metavar="ARCSEC", help="Standard error wanted about every axis.")
    ] = 2.0,
    report: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Report to write, .html or .txt.")
    ] = None,
    as_json: Json = False,
) -> int:
    """The rotation between star sensor and magnetometer, from a session of many orientations."""
    from agonic.alignment.files.read_session import read_session
    from agonic.alignment.report.alignment_text import alignment_text
    from agonic.alignment.star_sensor import fit_alignment
    from agonic.console.output import print_json, say
    from agonic.files.calibration import save

    groups = tuple(name.strip() for name in solve.split(",") if name.strip())
    fit = fit_alignment(read_session(session), solve=groups, wanted_sd_arcsec=wanted)
    usable = fit.verdict != "refused"
    files = [str(save(fit.calibration, out))] if out is not None and usable else []
    files += _reported(fit, report)
    if as_json:
        print_json("agonic/fit-alignment@1", {**record(fit), "files": files})
    else:
        say(alignment_text(fit))
        say(f"\nWritten   {', '.join(files)}" if files else "\nNothing was written.")
    return 0 if fit.verdict == "good" else 1


def _reported(fit: AlignmentFit, report: Path | None) -> list[str]:
    """The report in the form that its name asks for."""
    from agonic.alignment.report.alignment_page import alignment_page
    from agonic.alignment.report.alignment_text import alignment_text
    from agonic.console.printed_page import written_as_named

    return written_as_named(
        report, "--report", page=lambda: alignment_page(fit), text=lambda: alignment_text(fit)
    )


def record(fit: AlignmentFit) -> dict[str, Any]:
    """The fit as one object for programs; a refused one has no numbers."""
    from dataclasses import asdict

    from agonic.alignment.star_sensor import error_budget

    said: dict[str, Any] = {
        "method": "alignment",
        "sensor": fit.session.magnetometer.name,
        "verdict": fit.verdict,
        "status": fit.status,
        "n": fit.n,
        "solve": list(fit.solution.groups),
        "rank": fit.rank,
        "unknowns": int(fit.solution.free.sum()),
        "condition": fit.condition,
        "undetermined": list(fit.undetermined),
        "add": [list(orientation) for orientation in fit.add],
        "findings": [asdict(finding) for finding in fit.findings],
    }
    if fit.verdict == "refused":
        return said
    return {
        **said,
        **_numbers(fit),
        "error_budget": [asdict(effect) for effect in error_budget(fit)],
    }


def _numbers(fit: AlignmentFit) -> dict[str, Any]:
    """What was found, and how well it fits."""
    unknowns, sd = fit.solution.unknowns, fit.sd
    return {
        "angles_323_deg": fit.angles_deg,
        "angles_323_sd_arcsec": fit.angles_sd_arcsec,
        "quat_wxyz": fit.quat_wxyz,
        "quat_sd": fit.quat_sd,
        "matrix_mc": fit.rot_mc,
        "matrix_sd_arcsec": fit.matrix_sd_arcsec,
        "sd_arcsec": fit.sd_arcsec,
        "worst_sd_arcsec": fit.worst_sd_arcsec,
        "reference_turn_arcsec": fit.reference_turn_arcsec,
        "reference_232_deg": fit.reference_angles_deg,
        "pier_nT": unknowns.offset,
        "bias_nT": unknowns.bias,
        "matrix": unknowns.matrix,
        "sd": sd,
        "residual_rms_nT": fit.residual_rms,
        "chi2": fit.solution.chi2,
        "freedom": fit.solution.freedom,
        "orientations": [
            {
                "orientation": number,
                "residual_nT": fit.residuals[k],
                "sd_nT": fit.residuals_sd[k],
                "residual_arcsec": fit.residuals_arcsec[k],
            }
            for k, number in enumerate(fit.observed.orientation.tolist())
        ],
    }
