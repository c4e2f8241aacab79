"""`agonic calibrate LOG`: the main job."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import typer

from agonic.console.options import (
    Between,
    Course,
    Json,
    LogPath,
    Mounting,
    Place,
    ScalarChoice,
    SensorChoice,
)


def calibrate(
    context: typer.Context,
    log: LogPath,
    out: Path | None = None,
    which: SensorChoice = SensorChoice(),
    place: Place = Place(),
    scalar: ScalarChoice = ScalarChoice(),
    method: str = "auto",
    second: str | None = None,
    between: Between = None,
    course: Course = False,
    mounting: Mounting = None,
    store: Path | None = None,
    name: str | None = None,
    verbose: bool = False,
    show: bool = False,
    as_json: Json = False,
) -> int:
    """Calibrate every magnetometer in a log, verify it on held-out parts, and report.

    Writes report.html, a calibration file for each sensor that can be used, and exports for the
    autopilot the log came from. Exit status 1 where a sensor was refused or a check failed. A
    Parquet table of more than five million rows is read piece by piece.

    Options
    -------
    out -o DIR : Folder to write to; default: LOG-agonic.
    method : auto (by what the log holds), ellipsoid, levelled, inertial or vector.
    second auto|SENSOR : Combine two magnetometers, against what disturbs both; auto: where better.
    store STORE : Keep the result in this history as well.
    name --as INT16|NAME : How to read numbers that a logger wrote wrongly; or with --store its name
        in the history, by default its device number or the log's name.
    verbose -v : Notes, checks and the choice of method too.
    show --open : Open the report in a browser.
    """
    from agonic.console.finish import finish
    from agonic.console.options import list_typed_options
    from agonic.errors import check_choice
    from agonic.health.miscoding import WORDS
    from agonic.recording.document import describe_recording
    from agonic.recording.each_sensor import calibrate_each, refuse_of_two_axes
    from agonic.recording.files import choose_command, write_folder

    word = name if name in WORDS else None
    if word is None and name is not None and store is None:
        check_choice("--as", name, WORDS)
    check_choice("--method", method, ("auto", "ellipsoid", "levelled", "inertial", "vector"))
    folder = out or Path(f"{log.name}-agonic")
    recording, results, failures = calibrate_each(
        log,
        which,
        between,
        method,
        place=place,
        scalar=scalar,
        course=course,
        second=second,
        mounting=mounting,
        word=word,
    )
    if any(samples.axes == "xy" for samples in recording.sensors):
        refuse_of_two_axes(log, {"--store": store, "--as": name})
    written = write_folder(
        results, folder, title=recording.source.name, stack=recording.stack, failures=failures
    )
    if store is not None:
        from agonic.cli.keep import keep_results  # here, so that only a history loads a fleet

        known_as = None if word else name
        keep_results(store, results, recording, which.unit, place, method, between, known_as)
    document = describe_recording(results, written=written, failures=failures)
    command = choose_command(results, log, folder, list_typed_options(context))
    document = replace(document, next_step=command)
    page = folder / "report.html"
    return finish(document, page=page, as_json=as_json, brief=not verbose, open_page=show)
