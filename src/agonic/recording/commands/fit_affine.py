"""`agonic fit ellipsoid|levelled|inertial|vector|interference LOG`: one fit with every setting."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.console.options import (
    Between,
    Course,
    Json,
    LogPath,
    Out,
    Place,
    Robust,
    ScalarChoice,
    SensorChoice,
    Sources,
)
from agonic.console.parse import parse_names
from agonic.console.sensors import choose_name, open_sensor, open_sensors
from agonic.errors import AgonicError

if TYPE_CHECKING:
    from agonic.console.place import Beside
    from agonic.recording.calibrated import Calibrated
    from agonic.samples import Samples

SoftIron = Annotated[
    float, typer.Option(help="Prior on soft iron, standard deviation; 0 for none.")
]

HELP = {
    "levelled": "Bias and matrix of a vehicle that cannot tumble: roll, pitch and the field of the "
    "place.",
    "inertial": "Bias and matrix of what cannot be turned over: raw accelerometer and gyro.",
    "vector": "Bias and matrix where the whole attitude is known, heading included.",
    "interference": "Bias, matrix and the effect of currents, or a mix of two magnetometers.",
}
"""The fits that more than the magnitude aids, and what they find from what."""


def ellipsoid(
    log: LogPath,
    out: Out = None,
    which: SensorChoice = SensorChoice(),
    place: Place = Place(),
    scalar: ScalarChoice = ScalarChoice(),
    model: str = "auto",
    method: str = "likelihood",
    gauge: str = "symmetric",
    robust: Robust = True,
    soft_iron_sd: SoftIron = 0.1,
    between: Between = None,
    as_json: Json = False,
) -> int:
    """Bias and matrix from the magnitude alone.

    Options
    -------
    model : auto, sphere, diagonal or full.
    method : likelihood, adjusted, li-griffiths or linear.
    gauge : symmetric, or triangular.
    """
    from agonic.console.place import open_beside_scalar
    from agonic.recording.each_sensor import calibrate_mission, open_missions

    settings = {"model": model, "method": method, "gauge": gauge, "robust": robust}
    settings["soft_iron_sd"] = soft_iron_sd or None
    long = open_missions(log, *which, {"--between": between, "--scalar": scalar.column})
    if long:
        choose_name(one.sensor for one in long)
        return _finish(calibrate_mission(long[0], place, **settings), out, as_json)
    with open_beside_scalar(scalar) as beside:
        samples = open_sensor(log, *which, between)
    return _run("ellipsoid", samples, place, settings, out, as_json, beside)


def aided(
    context: typer.Context,
    log: LogPath,
    out: Out = None,
    which: SensorChoice = SensorChoice(),
    place: Place = Place(),
    sources: Sources = None,
    second: str | None = None,
    course: Course = False,
    model: str = "full",
    gauge: str = "auto",
    robust: Robust = True,
    soft_iron_sd: SoftIron = 0.1,
    turn_sd_deg: float = 2.0,
    between: Between = None,
    as_json: Json = False,
) -> int:
    """Bias and matrix, aided by the attitude; the kind says by how much of it.

    Options
    -------
    second SENSOR : The second magnetometer, for --with second.
    model : sphere, diagonal or full.
    gauge : symmetric; free (a turn of the sensor as well); or auto.
    turn_sd_deg : Prior on that turn, degrees, standard deviation; 0 for none.
    """
    kind = str(context.info_name)
    if place.field is not None and kind != "interference":
        raise AgonicError(f"--field is of no use to a {kind} fit, which needs --at and --date")
    if course and kind in ("levelled", "interference"):
        raise AgonicError(f"--course is of no use to a {kind} fit: ask for inertial or vector")
    if sources is None:
        sources = "current_A" if kind == "interference" else ""
    settings: dict[str, Any] = {"model": model, "gauge": gauge, "robust": robust}
    settings |= {"soft_iron_sd": soft_iron_sd or None, "turn_sd_deg": turn_sd_deg or None}
    settings["sources"] = parse_names(sources)
    samples = _open_beside_second(log, which, between, second, settings["sources"])
    if course:
        from agonic.attitude.heading_source import with_course

        samples = with_course(samples)
    return _run(kind, samples, place, settings, out, as_json)


def _open_beside_second(
    log: Path,
    which: SensorChoice,
    between: str | None,
    second: str | None,
    sources: tuple[str, ...],
) -> Samples:
    """The sensor of the log that was asked for, or its only one, perhaps beside a second."""
    recording, sensors = open_sensors(log, *which, between)
    choose_name(samples.name for samples in sensors)
    mixed = "second" in sources
    if second is None:
        if mixed and sensors[0].second is None:
            names = ", ".join(samples.name for samples in recording.sensors)
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
    place: Place,
    settings: dict[str, Any],
    out: Path | None,
    as_json: bool,
    beside: Beside | None = None,
) -> int:
    """Fit, verify, write, and say so."""
    from agonic.console.place import find_reference
    from agonic.recording.calibrated import calibrate_as_named

    reference, of_place = find_reference(samples, *place)
    if beside is not None:
        given = place.at is not None or place.field is not None
        samples, reference = beside.refer(samples, reference, given=given)
    result = calibrate_as_named(samples, reference, kind=kind, **settings, **of_place)  # type: ignore[arg-type]
    return _finish(result, out, as_json)


def _finish(result: Calibrated, out: Path | None, as_json: bool) -> int:
    """Write the calibration where it can be used, and say what came of it."""
    from agonic.console.finish import finish
    from agonic.recording.document import describe_sensor

    return finish(describe_sensor(result), out=out, as_json=as_json)
