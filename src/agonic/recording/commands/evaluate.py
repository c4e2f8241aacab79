"""`agonic evaluate LOG`: a calibration judged on parts of its log that it has not seen."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from agonic.console.options import Between, Json, LogPath, Place, Report, SensorChoice

if TYPE_CHECKING:
    from agonic.recording.evaluation.cross_validation import Evaluation
    from agonic.samples import Samples


def evaluate(
    log: LogPath,
    truth: Path | None = None,
    which: SensorChoice = SensorChoice(),
    place: Place = Place(),
    method: str = "auto",
    between: Between = None,
    report: Report = None,
    as_json: Json = False,
) -> int:
    """Judge calibration and heading on parts of a log that they have not seen.

    Found errors are compared with the stated ones, and with those of the readings as recorded. The
    heading is compared with that of --truth, or with an independent one in the log. Exit status 1
    where the calibration is refused or doubtful, or errors are larger than stated.

    Options
    -------
    truth FILE : Another record of the heading: a log, or a table with time_s, heading_deg and
        perhaps roll_deg, pitch_deg, by the clock of the log.
    method : auto (by what the log holds), ellipsoid, levelled, inertial or vector.
    """
    from agonic.console.finish import finish
    from agonic.console.progress import progress
    from agonic.console.sensors import open_sensors
    from agonic.errors import CoverageError, check_choice
    from agonic.recording.evaluation.document import describe_evaluation

    check_choice("--method", method, ("auto", "ellipsoid", "levelled", "inertial", "vector"))
    recording, sensors = open_sensors(log, *which, between)
    results, failures = [], []
    for one in progress([(one.name, one) for one in sensors], "Evaluating"):
        try:
            results.append(_run(one[1], truth, method, place))
        except CoverageError as error:
            failures.append((one[0], str(error)))
    document = describe_evaluation(results, title=recording.source.name, failures=failures)
    return finish(document, report=report, as_json=as_json)


def _run(samples: Samples, truth: Path | None, method: Any, place: Place) -> Evaluation:
    """The evaluation of one sensor."""
    from agonic.console.place import find_reference
    from agonic.logs.other_instrument import read_attitude_beside
    from agonic.recording.evaluation.cross_validation import evaluate as judge

    beside = None
    if truth is not None:
        samples, beside = read_attitude_beside(truth, samples)
    blind = samples if method == "vector" else samples.with_columns(heading_deg=None)
    reference, settings = find_reference(blind, *place)
    return judge(samples, reference, truth=beside, kind=method, **settings)
