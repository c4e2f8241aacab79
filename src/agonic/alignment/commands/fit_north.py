"""`agonic fit north SESSION|SHEET`: true north, azimuths, and absolute measurements."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.console.options import Json, Magnitude

if TYPE_CHECKING:
    from agonic.alignment.north import DiFluxFit, NorthFit

Report = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Report to write, .html or .txt.")
]
Out = Annotated[
    Path | None, typer.Option("-o", "--out", metavar="CAL", help="Calibration file to write.")
]


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
    from agonic.errors import AgonicError

    if session.is_file() and is_di_flux(session):
        if out is not None:
            raise AgonicError("a DI-flux sheet gives no calibration; leave -o out")
        return _sheet(session, field, report, as_json)
    if field is not None:
        raise AgonicError("--field belongs to DI-flux sheets; a gyrotheodolite needs none")
    return _gyro(session, out, report, as_json)


def _gyro(session: Path, out: Path | None, report: Path | None, as_json: bool) -> int:
    from agonic.alignment.files.read_north import read_north
    from agonic.alignment.north import fit_north
    from agonic.alignment.report.north_page import north_page
    from agonic.alignment.report.north_text import north_text
    from agonic.console.output import print_json, say
    from agonic.errors import AgonicError
    from agonic.files.calibration import save

    fit = fit_north(read_north(session))
    usable = fit.verdict != "refused"
    if out is not None and fit.calibration is None:
        raise AgonicError("-o needs an alignment: give [platform], [magnetometer] and [reference]")
    files = [] if out is None or not usable else [str(save(fit.calibration, out))]  # type: ignore[arg-type]
    files += reported(report, lambda: north_text(fit), lambda: north_page(fit))
    if as_json:
        print_json("agonic/fit-north@1", {**north_record(fit), "files": files})
    else:
        say(north_text(fit))
        say(f"\nWritten   {', '.join(files)}" if files else "\nNothing was written.")
    return 0 if fit.verdict == "good" else 1


def _sheet(sheet: Path, field: float | None, report: Path | None, as_json: bool) -> int:
    from agonic.alignment.files.read_di_flux import read_di_flux
    from agonic.alignment.north import fit_di_flux
    from agonic.alignment.report.north_page import di_flux_page
    from agonic.alignment.report.north_text import di_flux_text
    from agonic.console.output import print_json, say

    fit = fit_di_flux(read_di_flux(sheet), magnitude=field)
    files = reported(report, lambda: di_flux_text(fit), lambda: di_flux_page(fit))
    if as_json:
        print_json("agonic/fit-di-flux@1", {**di_flux_record(fit), "files": files})
    else:
        say(di_flux_text(fit))
        if files:
            say(f"\nWritten   {', '.join(files)}")
    return 0 if fit.verdict == "good" else 1


def reported(path: Path | None, text: Callable[[], str], page: Callable[[], str]) -> list[str]:
    """The report in the form that its name asks for."""
    from agonic.atomic import write_atomically
    from agonic.errors import AgonicError

    if path is None:
        return []
    if path.suffix.lower() in (".html", ".htm"):
        return [str(write_atomically(path, page()))]
    if path.suffix.lower() == ".txt":
        return [str(write_atomically(path, text() + "\n"))]
    raise AgonicError(f"--report {path} is no kind of report; name it .html or .txt")


def north_record(fit: NorthFit) -> dict[str, Any]:
    """The fit as one object for programs."""
    from dataclasses import asdict

    said: dict[str, Any] = {
        "method": fit.method,
        "verdict": fit.verdict,
        "status": fit.status,
        "findings": [asdict(finding) for finding in fit.findings],
    }
    if fit.verdict == "refused":
        return said
    said |= {
        "north_deg": fit.north_deg,
        "north_sd_arcsec": fit.sd_arcsec,
        "by": {
            name: {
                "gyro_north_deg": found.reading_deg,
                "sd_arcsec": 3600 * found.sd_deg,
                "freedom": found.freedom,
            }
            for name, found in fit.by.items()
        },
        "transit_constant": fit.constant,
        "transit_constant_sd": fit.constant_sd,
        "period_s": fit.period_s,
        "azimuths": [asdict(azimuth) for azimuth in fit.azimuths],
    }
    found = fit.aligned
    if found is not None:
        said |= {
            "n": len(found.orientation),
            "matrix_mb": found.rot_mb,
            "sd_arcsec": found.sd_arcsec,
            "worst_sd_arcsec": found.worst_sd_arcsec,
            "residuals_nT": found.residuals,
            "chi2": found.chi2,
            "freedom": found.freedom,
        }
    return said


def di_flux_record(fit: DiFluxFit) -> dict[str, Any]:
    """The measurement as one object for programs."""
    from dataclasses import asdict

    delta, epsilon = fit.collimation_arcsec
    delta_sd, epsilon_sd = fit.collimation_sd_arcsec
    return {
        "verdict": fit.verdict,
        "status": fit.status,
        "n": fit.n,
        "freedom": fit.estimate.freedom,
        "declination_deg": fit.declination_deg,
        "declination_sd_arcsec": fit.declination_sd_arcsec,
        "inclination_deg": fit.inclination_deg,
        "inclination_sd_arcsec": fit.inclination_sd_arcsec,
        "meridian_deg": fit.meridian_deg,
        "meridian_sd_arcsec": fit.meridian_sd_arcsec,
        "mark_deg": fit.mark.reading_deg,
        "mark_sd_arcsec": 3600 * fit.mark.sd_deg,
        "telescope_collimation_arcsec": 3600 * fit.mark.collimation_deg,
        "delta_arcsec": delta,
        "delta_sd_arcsec": delta_sd,
        "epsilon_arcsec": epsilon,
        "epsilon_sd_arcsec": epsilon_sd,
        "offset_arcsec": fit.offset_arcsec[0],
        "offset_sd_arcsec": fit.offset_arcsec[1],
        "offset": fit.offset if fit.scaled else None,
        "offset_sd": fit.offset_sd if fit.scaled else None,
        "scale": fit.scale if fit.scaled else None,
        "magnitude_nT": fit.sheet.magnitude,
        "noise_arcsec": fit.noise_arcsec,
        "findings": [asdict(finding) for finding in fit.findings],
    }
