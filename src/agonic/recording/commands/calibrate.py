"""`agonic calibrate LOG`: the main job."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from agonic.console.options import (
    At,
    Between,
    Date,
    Json,
    LogPath,
    Magnitude,
    Sensor,
    Unit,
)
from agonic.console.sensors import open_sensors

if TYPE_CHECKING:
    from agonic.logs.large.mission import Mission
    from agonic.recording.calibrated import Calibrated
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
    store: Annotated[
        Path | None,
        typer.Option("--store", metavar="STORE", help="Keep the result in this history as well."),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(
            "--as",
            metavar="NAME",
            help="Who the sensor is in the history; default: its device number, or the log's name.",
        ),
    ] = None,
    as_json: Json = False,
) -> int:
    """Calibrate every magnetometer in a log, verify it on held-out parts, and report.

    Writes report.html, a calibration file for each sensor that can be used, and exports for the
    autopilot the log came from. Exit status 1 where a sensor was refused or a check failed. A
    Parquet table of more than five million rows is read piece by piece.
    """
    from agonic.console.output import print_json, say
    from agonic.errors import check_choice
    from agonic.recording.out_of_core import log_of, missions
    from agonic.recording.report.folder import write_folder
    from agonic.recording.report.record import record
    from agonic.recording.report.text import summary

    check_choice("--method", method, ("auto", "ellipsoid", "levelled", "vector"))
    taught = f"--method {method}" if method in ("levelled", "vector") else None
    long = missions(log, sensor, unit, {"--between": between, f"--method {method}": taught})
    if long:
        results, failures = _results([_of_mission(one, at, date, field) for one in long])
        recording = log_of(long[0], results)
    else:
        recording, sensors = open_sensors(log, sensor, unit, between)
        results, failures = _results([_of(one, at, date, field, method) for one in sensors])
    folder = out or Path(f"{log.name}-agonic")
    written = write_folder(results, folder, title=recording.source.name, stack=recording.stack)
    if store is not None:
        from agonic.console.parse import parse_position
        from agonic.fleet.settings import FleetSettings
        from agonic.history.command import keep

        asked = FleetSettings(
            unit=unit,
            at=parse_position(at) if at else None,
            date=date,
            field_nT=field,
            method=method,
        )
        keep(store, results, recording, asked, between, name)
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


_Job = tuple[str, Callable[[], "Calibrated"]]


def _of(
    samples: Samples, at: str | None, date: str | None, field: float | None, method: str
) -> _Job:
    """A sensor, and what calibrates it."""

    def run() -> Calibrated:
        from agonic.console.place import find_reference
        from agonic.recording.calibrated import calibrate as run_in_memory

        reference, settings = find_reference(samples, at, date, field)
        return run_in_memory(samples, reference, kind=method, **settings)  # type: ignore[arg-type]

    return samples.name, run


def _of_mission(mission: Mission, at: str | None, date: str | None, field: float | None) -> _Job:
    """A sensor of a recording longer than memory, and what calibrates it."""
    from agonic.recording.out_of_core import calibrated

    return mission.head().name, lambda: calibrated(mission, at, date, field)


def _results(jobs: Sequence[_Job]) -> tuple[list[Calibrated], list[dict[str, object]]]:
    """The sensors that could be fitted, and records of those that could not."""
    from agonic.console.progress import progress
    from agonic.errors import CoverageError
    from agonic.recording.report.record import unfitted

    results: list[Calibrated] = []
    failures: list[dict[str, object]] = []
    for name, run in progress(jobs, "Calibrating"):
        try:
            results.append(run())
        except CoverageError as error:
            failures.append(unfitted(name, str(error)))
    return results, failures
