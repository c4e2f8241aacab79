"""`agonic fit KIND LOG`: one fit with every setting."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.alignment.commands import fit_alignment, fit_coil, fit_gravity, fit_north
from agonic.attitude import command
from agonic.console.options import (
    At,
    Between,
    Date,
    Json,
    LogPath,
    Magnitude,
    Sensor,
    Unit,
    log_and_sensors,
)
from agonic.errors import AgonicError
from agonic.headings.commands import fit_deviation
from agonic.inflight.commands import fit_inflight
from agonic.network.commands import fit_network
from agonic.thermal.commands import fit as fit_thermal

if TYPE_CHECKING:
    from agonic.recording.calibrated import Calibrated
    from agonic.samples import Samples

Out = Annotated[
    Path | None, typer.Option("-o", "--out", metavar="CAL", help="Calibration file to write.")
]
Robust = Annotated[bool, typer.Option(help="Meet outliers with Tukey's loss.")]
SoftIron = Annotated[
    float, typer.Option(help="Prior on soft iron, standard deviation; 0 for none.")
]
Model = Annotated[str, typer.Option(help="sphere, diagonal or full.")]
FreeGauge = Annotated[
    str, typer.Option(help="symmetric; free (a turn of the sensor as well); or auto.")
]
Turn = Annotated[
    float, typer.Option(help="Prior on that turn, degrees, standard deviation; 0 for none.")
]
Sources = Annotated[
    str,
    typer.Option(
        "--with", metavar="NAMES", help="What disturbs on board: current_A, throttle, second."
    ),
]
Second = Annotated[
    str | None,
    typer.Option("--second", metavar="SENSOR", help="The second magnetometer, for --with second."),
]


def add_to(app: typer.Typer) -> None:
    """Register the command and its kinds."""
    kinds = typer.Typer(help="Fit one kind of calibration to a log.", no_args_is_help=True)
    for kind in (ellipsoid, levelled, vector, interference):
        kinds.command(kind.__name__)(kind)
    fit_deviation.add_to(kinds)
    fit_inflight.add_to(kinds)
    command.add_to(kinds)
    fit_network.add_to(kinds)
    fit_thermal.add_to(kinds)
    fit_alignment.add_to(kinds)
    fit_north.add_to(kinds)
    fit_coil.add_to(kinds)
    fit_gravity.add_to(kinds)
    app.add_typer(kinds, name="fit", rich_help_panel=None)


def ellipsoid(
    log: LogPath,
    out: Out = None,
    sensor: Sensor = None,
    unit: Unit = None,
    at: At = None,
    date: Date = None,
    field: Magnitude = None,
    model: Annotated[str, typer.Option(help="auto, sphere, diagonal or full.")] = "auto",
    method: Annotated[
        str, typer.Option(help="likelihood, adjusted, li-griffiths or linear.")
    ] = "likelihood",
    gauge: Annotated[str, typer.Option(help="symmetric, or triangular.")] = "symmetric",
    robust: Robust = True,
    soft_iron_sd: SoftIron = 0.1,
    between: Between = None,
    as_json: Json = False,
) -> int:
    """Bias and matrix from the magnitude alone."""
    from agonic.console.out_of_core import calibrated, missions

    settings = {"model": model, "method": method, "gauge": gauge, "robust": robust}
    settings["soft_iron_sd"] = soft_iron_sd or None
    long = missions(log, sensor, unit, {"--between": between})
    if len(long) > 1:
        names = ", ".join(str(one.sensor) for one in long)
        raise AgonicError(f"the log holds {names}; choose one with --sensor")
    if long:
        return _told(calibrated(long[0], at, date, field, **settings), out, as_json)
    samples = _sensor(log, sensor, unit, between)
    return _run("ellipsoid", samples, (at, date, field), settings, out, as_json)


def levelled(
    log: LogPath,
    out: Out = None,
    sensor: Sensor = None,
    unit: Unit = None,
    at: At = None,
    date: Date = None,
    sources: Sources = "",
    second: Second = None,
    model: Model = "full",
    gauge: FreeGauge = "auto",
    robust: Robust = True,
    soft_iron_sd: SoftIron = 0.1,
    turn_sd_deg: Turn = 2.0,
    between: Between = None,
    as_json: Json = False,
) -> int:
    """Bias and matrix of a vehicle that cannot tumble: roll, pitch and the field of the place."""
    settings = _taught(sources, model, gauge, robust, soft_iron_sd, turn_sd_deg)
    samples = _sensor(log, sensor, unit, between, second, settings["sources"])
    return _run("levelled", samples, (at, date, None), settings, out, as_json)


def vector(
    log: LogPath,
    out: Out = None,
    sensor: Sensor = None,
    unit: Unit = None,
    at: At = None,
    date: Date = None,
    sources: Sources = "",
    second: Second = None,
    model: Model = "full",
    gauge: FreeGauge = "auto",
    robust: Robust = True,
    soft_iron_sd: SoftIron = 0.1,
    turn_sd_deg: Turn = 2.0,
    between: Between = None,
    as_json: Json = False,
) -> int:
    """Bias and matrix where the whole attitude is known, heading included."""
    settings = _taught(sources, model, gauge, robust, soft_iron_sd, turn_sd_deg)
    samples = _sensor(log, sensor, unit, between, second, settings["sources"])
    return _run("vector", samples, (at, date, None), settings, out, as_json)


def interference(
    log: LogPath,
    out: Out = None,
    sensor: Sensor = None,
    unit: Unit = None,
    at: At = None,
    date: Date = None,
    field: Magnitude = None,
    sources: Sources = "current_A",
    second: Second = None,
    model: Model = "full",
    gauge: FreeGauge = "auto",
    robust: Robust = True,
    soft_iron_sd: SoftIron = 0.1,
    turn_sd_deg: Turn = 2.0,
    between: Between = None,
    as_json: Json = False,
) -> int:
    """What currents on board, or a second magnetometer, say of the disturbance."""
    settings = _taught(sources, model, gauge, robust, soft_iron_sd, turn_sd_deg)
    samples = _sensor(log, sensor, unit, between, second, settings["sources"])
    return _run("interference", samples, (at, date, field), settings, out, as_json)


def _taught(
    sources: str, model: str, gauge: str, robust: bool, soft_iron_sd: float, turn_sd_deg: float
) -> dict[str, Any]:
    """The settings of the fits that the attitude teaches."""
    return {
        "sources": tuple(name.strip() for name in sources.split(",") if name.strip()),
        "model": model,
        "gauge": gauge,
        "robust": robust,
        "soft_iron_sd": soft_iron_sd or None,
        "turn_sd_deg": turn_sd_deg or None,
    }


def _sensor(
    log: Path,
    sensor: str | None,
    unit: str | None,
    between: str | None,
    second: str | None = None,
    sources: tuple[str, ...] = (),
) -> Samples:
    """The sensor of the log that was asked for, or its only one, perhaps beside a second."""
    recording, sensors = log_and_sensors(log, sensor, unit, between)
    names = ", ".join(samples.name for samples in recording.sensors)
    if len(sensors) > 1:
        raise AgonicError(f"the log holds {names}; choose one with --sensor")
    mixed = "second" in sources
    if second is None:
        if mixed and sensors[0].second is None:
            raise AgonicError(
                f"--with second needs to know which magnetometer: name it with --second; the log "
                f"holds {names}"
            )
        return sensors[0]
    if not mixed:
        raise AgonicError(
            f"--second {second} is not used without --with second (--with current_A,second takes "
            "both)"
        )
    return sensors[0].with_second(recording.sensor(second))


def _run(
    kind: str,
    samples: Samples,
    place: tuple[str | None, str | None, float | None],
    settings: dict[str, Any],
    out: Path | None,
    as_json: bool,
) -> int:
    """Fit, verify, write, and say so."""
    from agonic.console.place import expected
    from agonic.recording.calibrated import calibrate

    reference, of_place = expected(samples, *place)
    result = calibrate(samples, reference, kind=kind, **settings, **of_place)  # type: ignore[arg-type]
    return _told(result, out, as_json)


def _told(result: Calibrated, out: Path | None, as_json: bool) -> int:
    """Write the calibration where it can be used, and say what came of it."""
    from agonic.console.output import print_json, say
    from agonic.files.calibration import save
    from agonic.recording.report.record import record
    from agonic.recording.report.text import summary

    files = [str(save(result.fit.calibration, out))] if out and result.verdict != "refused" else []
    if as_json:
        print_json("agonic/fit@1", record(result, files))
    else:
        say(summary([result]))
        say(f"\nWritten   {files[0]}" if files else "\nNothing was written.")
    return 0 if result.verdict == "good" else 1
