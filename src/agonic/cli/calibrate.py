"""`agonic calibrate LOG`: the main job."""

from __future__ import annotations

import glob
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

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
    from agonic.io.log import Log
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
    from agonic.report.record import record
    from agonic.report.text import summary

    recording, sensors = log_and_sensors(log, sensor, unit, between)
    folder = out or Path(f"{log.name}-agonic")
    results, failures = _results(sensors, at, date, field, method)
    written = write(results, recording, folder)
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


class Written(NamedTuple):
    """The files of one sensor, and what its exports do not hold or do."""

    files: list[str]
    warnings: list[str]


def write(results: list[Calibrated], log: Log, folder: Path) -> dict[str, Written]:
    """Calibration files, exports and report; returns what was written for each sensor."""
    from agonic.io.atomic import make_folder, write_atomically
    from agonic.report.html import render

    make_folder(folder)
    written = {result.samples.name: _sensor_files(result, log.stack, folder) for result in results}
    files = {name: of_sensor.files for name, of_sensor in written.items()}
    setup = _setup(results, written, folder)
    page = str(folder / "report.html")
    write_atomically(page, render(results, title=log.path.name, exports=files))
    return {name: Written([*w.files, *setup, page], w.warnings) for name, w in written.items()}


def _setup(results: list[Calibrated], written: dict[str, Written], folder: Path) -> list[str]:
    """The setup of the vehicle, for `agonic heading`, where its compasses can be used as such."""
    from agonic.calibration.setup import Compass, Setup
    from agonic.io.setupfile import save_setup

    compasses = {
        result.samples.name: Compass(
            calibration=result.fit.calibration,
            latency_s=result.latency.latency_s if result.latency else 0.0,
        )
        for result in results
        if written[result.samples.name].files and result.fit.calibration.unit_out == "nT"
    }
    if not compasses:
        return []
    saved = {name: Path(written[name].files[0]).name for name in compasses}
    setup = Setup(compasses=tuple(compasses.values()))
    return [str(save_setup(setup, folder / "setup.toml", saved=saved))]


def _sensor_files(result: Calibrated, stack: str, folder: Path) -> Written:
    """The calibration file, a C header, and parameters for the stack the log came from.

    Nothing is written of a refused calibration, nor parameters for an autopilot whose own
    correction is still in the readings.
    """
    from agonic.errors import UnitError
    from agonic.io.calfile import save
    from agonic.io.targets import SUFFIXES, TARGETS
    from agonic.io.targets import write as write_target

    stem = folder / file_stem(result.samples.name)
    if result.verdict == "refused":
        old = [path.name for path in folder.glob(f"{glob.escape(stem.name)}.*")]
        stale = f"{', '.join(sorted(old))}: of an earlier run, not of this report"
        return Written([], [stale] if old else [])
    calibration = result.fit.calibration
    written = Written([str(save(calibration, stem.with_suffix(".json")))], [])
    autopilot = (stack,) if stack in TARGETS and not result.samples.corrected else ()
    for target in ("c", *autopilot):
        try:
            export = write_target(target, calibration, stem.with_suffix(SUFFIXES[target]))
        except UnitError as error:  # raw units have no place in an autopilot
            written.warnings.append(f"no export for {target}: {error}")
            continue
        written.files.append(str(export.path))
        written.warnings.extend(f"{export.path.name}: {text}" for text in export.warnings)
    return written


def file_stem(sensor: str) -> str:
    """A sensor's name as part of a file name.

    >>> file_stem("sensor_mag[0]")
    'sensor_mag_0'
    """
    kept = "".join(c if c.isalnum() or c in "-_" else "_" for c in sensor)
    return kept.strip("_") or "sensor"
