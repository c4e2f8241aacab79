"""`agonic calibrate LOG`: the main job."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from agonic.cli.options import (
    At,
    Between,
    Date,
    Json,
    LogPath,
    Magnitude,
    Sensor,
    Unit,
    log_and_sensors,
)  # fmt: skip

if TYPE_CHECKING:
    from agonic.calibrated import Calibrated
    from agonic.samples import Samples


def add_to(app: typer.Typer) -> None:
    """Register the command."""
    app.command("calibrate")(calibrate)


def calibrate(
    log: LogPath,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="DIR", help="Folder to write to; default: LOG-agonic."),
    ] = None,
    sensor: Sensor = None,
    unit: Unit = None,
    at: At = None,
    date: Date = None,
    field: Magnitude = None,
    method: Annotated[
        str, typer.Option(help="auto (by what the log holds), ellipsoid, levelled or vector.")
    ] = "auto",
    between: Between = None,
    as_json: Json = False,
) -> int:
    """Calibrate every magnetometer in a log, verify it on held-out parts, and report.

    Writes report.html, a calibration file for each sensor that can be used, and exports for the
    autopilot the log came from. Exit status 1 where a sensor was refused or a check failed.
    """
    from agonic.cli.output import print_json, say
    from agonic.report.folder import write_folder
    from agonic.report.record import record
    from agonic.report.text import summary

    recording, sensors = log_and_sensors(log, sensor, unit, between)
    folder = out or Path(f"{log.name}-agonic")
    results, failures = _results(sensors, at, date, field, method)
    written = write_folder(results, folder, title=recording.path.name, stack=recording.stack)
    if as_json:
        records = [record(result, *written[result.samples.name]) for result in results]
        print_json("agonic/calibrate@1", {"sensors": records + failures})
    else:
        if results or not failures:
            say(summary(results))
        for failure in failures:
            say(f"\n✗ {failure['sensor']}: refused\n  {failure['status']}")
        for of_sensor in written.values():
            for warning in of_sensor.warnings:
                say(f"\nWarning   {warning}")
        say(f"\nReport    {folder / 'report.html'}")
    return 0 if not failures and all(result.verdict == "good" for result in results) else 1


def _results(
    sensors: tuple[Samples, ...],
    at: str | None,
    date: str | None,
    field: float | None,
    method: str,
) -> tuple[list[Calibrated], list[dict[str, object]]]:
    """The sensors that could be fitted, and records of those that could not."""
    from agonic.calibrated import calibrate as run
    from agonic.cli.place import expected
    from agonic.cli.progress import progress
    from agonic.errors import CoverageError, check_choice
    from agonic.report.record import unfitted

    check_choice("--method", method, ("auto", "ellipsoid", "levelled", "vector"))
    results: list[Calibrated] = []
    failures: list[dict[str, object]] = []
    for samples in progress(sensors, "Calibrating"):
        try:
            reference, settings = expected(samples, at, date, field)
            results.append(run(samples, reference, kind=method, **settings))  # type: ignore[arg-type]
        except CoverageError as error:
            failures.append(unfitted(samples.name, str(error)))
    return results, failures
