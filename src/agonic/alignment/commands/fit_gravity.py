"""`agonic fit gravity LOG -o CAL`: how a magnetometer sits on an accelerometer."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.alignment.commands.fit_north import Out
from agonic.console.options import Between, Json, LogPath, Sensor, Unit, log_and_sensors

if TYPE_CHECKING:
    from agonic.alignment.gravity import GravityFit


def add_to(kinds: typer.Typer) -> None:
    """Register the kind of fit."""
    kinds.command("gravity")(gravity)


def gravity(
    log: LogPath,
    out: Out = None,
    sensor: Sensor = None,
    unit: Unit = None,
    calibration: Annotated[
        Path | None,
        typer.Option("--calibration", metavar="CAL", help="Of the magnetometer, applied first."),
    ] = None,
    bias: Annotated[bool, typer.Option("--bias", help="Seek the magnetometer's bias too.")] = False,
    between: Between = None,
    as_json: Json = False,
) -> int:
    """The rotation from magnetometer to accelerometer, from orientations at rest."""
    from agonic.alignment.gravity import fit_gravity
    from agonic.alignment.report.north_text import gravity_text
    from agonic.calibration.chain import require_calibration
    from agonic.console.output import print_json, say
    from agonic.errors import AgonicError
    from agonic.files.calibration import load, save

    _, sensors = log_and_sensors(log, sensor, unit, between)
    if len(sensors) > 1:
        names = ", ".join(samples.name for samples in sensors)
        raise AgonicError(f"the log holds {names}; choose one with --sensor")
    known = None if calibration is None else require_calibration(load(calibration))
    fit = fit_gravity(sensors[0], known, bias=bias)
    usable = fit.verdict != "refused"
    files = [str(save(fit.calibration, out))] if out is not None and usable else []
    if as_json:
        print_json(
            "agonic/fit-gravity@1", {"sensor": sensors[0].name, **record(fit), "files": files}
        )
    else:
        say(gravity_text(fit, sensors[0].name))
        say(f"\nWritten   {', '.join(files)}" if files else "\nNothing was written.")
    return 0 if fit.verdict == "good" else 1


def record(fit: GravityFit) -> dict[str, Any]:
    """The fit as one object for programs; a refused one has no numbers."""
    from dataclasses import asdict

    said: dict[str, Any] = {
        "verdict": fit.verdict,
        "status": fit.status,
        "n": fit.n,
        "findings": [asdict(finding) for finding in fit.findings],
    }
    if fit.verdict == "refused":
        return said
    return said | {
        "matrix_bm": fit.rot_bm,
        "turn_deg": fit.angle_deg,
        "sd_deg": fit.sd_deg,
        "worst_sd_deg": fit.worst_sd_deg,
        "inclination_deg": fit.inclination_deg,
        "bias": fit.estimate.bias,
        "residuals": fit.estimate.residuals,
    }
