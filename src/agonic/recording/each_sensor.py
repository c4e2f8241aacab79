"""Every magnetometer of a log calibrated; one that cannot be does not stop the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.linalg import LinAlgError

from agonic.attitude.course import with_course
from agonic.console.mounting import parse_mounting
from agonic.console.place import find_reference
from agonic.console.progress import counting, progress, waiting
from agonic.console.sensors import open_sensors
from agonic.errors import AgonicError, CoverageError
from agonic.health.decoding import read_as
from agonic.logs.log import Log
from agonic.logs.remote import name_locally
from agonic.recording.calibrated import Calibrated, calibrate_as_named, calibrate_recording
from agonic.recording.mounting import calibrate, turn_back, turn_readings
from agonic.recording.pair import require_reference, take_mixes, tell_pairs
from agonic.samples import Samples

if TYPE_CHECKING:
    from agonic.logs.large.mission import Mission

_Job = tuple[str, Callable[[], Calibrated]]
"""The name of a sensor, and what calibrates it."""


def calibrate_each(
    log: Path,
    sensor: str | None,
    unit: str | None,
    between: str | None,
    method: str,
    *,
    at: str | None,
    date: str | None,
    field: float | None,
    course: bool = False,
    second: str | None = None,
    mounting: str | None = None,
    word: str | None = None,
) -> tuple[Log, list[Calibrated], list[tuple[str, str]]]:
    """The log, the sensors that could be fitted, and the names of others with the reason.

    With `course` the course over ground is taken for the heading. `second`: "auto" mixes in another
    sensor where that is better; a name, that one. `mounting`: where the axes of the sensor point.
    `word`: how numbers are to be read.
    """
    turn = None if mounting is None else parse_mounting(mounting)
    if turn is not None and second is not None:
        raise AgonicError("--mounting turns one sensor; mix in a second one (--second) without it")
    all_rows = {
        "--between": between,
        f"--method {method}": method in ("levelled", "inertial", "vector"),
        "--course": course,
        "--mounting": mounting,
        "--as": word,
    }
    long = open_missions(log, sensor, unit, all_rows)
    if long:
        results, failures = _run(
            [(one.head().name, partial(calibrate_mission, one, at, date, field)) for one in long]
        )
        return make_log(long[0], results), results, failures

    def run(samples: Samples) -> Calibrated:
        if course:
            samples = with_course(samples)
        reference, settings = find_reference(samples, at, date, field)
        kind: Any = method
        if turn is None:
            return calibrate(samples, reference, kind=kind, **settings)
        turned = turn_readings(samples, turn)
        return turn_back(calibrate_as_named(turned, reference, kind=kind, **settings), turn)

    def mix(samples: Samples) -> Calibrated:
        reference, settings = find_reference(samples, at, date, field)
        known = require_reference(reference)
        return calibrate_as_named(
            samples, known, kind="interference", sources=("second",), **settings
        )

    recording, sensors = open_sensors(log, None if second else sensor, unit, between)
    if word is not None:
        sensors = tuple(read_as(samples, word) for samples in sensors)
    if second not in (None, "auto"):
        recording.sensor(second)  # an error names those that there are
    results, failures = _run([(one.name, partial(run, one)) for one in sensors])
    if second is None:
        return recording, tell_pairs(results), failures
    mixed = take_mixes(results, mix, second)
    wanted = recording.sensor(sensor).name if sensor is not None else None
    return recording, [r for r in mixed if wanted in (None, r.samples.name)], failures


def _run(jobs: Sequence[_Job]) -> tuple[list[Calibrated], list[tuple[str, str]]]:
    results: list[Calibrated] = []
    failures: list[tuple[str, str]] = []
    for name, run in progress(jobs, "Calibrating"):
        try:
            with waiting(f"Calibrating {name}") if len(jobs) == 1 else nullcontext():
                results.append(run())
        except CoverageError as error:
            failures.append((name, str(error)))
        except (ArithmeticError, LinAlgError) as error:  # nor do numbers that no sensor gives
            why = " ".join(f"{type(error).__name__}: {error}".split())
            move = "look for values that no sensor gives, and leave those rows out (--between)"
            failures.append((name, f"the readings could not be computed with ({why}): {move}"))
    return results, failures


def open_missions(
    log: Path, sensor: str | None, unit: str | None, all_rows: Mapping[str, str | bool | None]
) -> tuple[Mission, ...]:
    """One for each magnetometer of a table too long for memory; none where it is not.

    Nor where a column names the sensor row by row. `all_rows` are options that need all rows at
    once, with what was given, if anything.
    """
    from agonic.logs.large.mission import is_long, open_mission  # few logs are as long

    if not is_long([log]):
        return ()
    mission = open_mission([log], sensor=sensor, unit=unit)
    names = mission.sensors()
    given = [name for name, value in all_rows.items() if value]
    if names and given:
        raise AgonicError(
            f"{log.name} has {mission.rows} rows and is read piece by piece, by the magnitude "
            f"alone, without {', '.join(given)}; cut it, or leave that away"
        )
    if sensor is not None:
        return (mission,) if names else ()
    return tuple(replace(mission, sensor=name) for name in names)


def calibrate_mission(
    mission: Mission, at: str | None, date: str | None, field: float | None, **settings: Any
) -> Calibrated:
    """The calibration of a mission, with the field of the place."""
    reference, of_place = find_reference(mission.head(), at, date, field)
    with counting(mission.rows) as tell:
        return calibrate_recording(mission, reference, progress=tell, **settings, **of_place)


def make_log(mission: Mission, results: list[Calibrated]) -> Log:
    """The rows that were kept of a mission, as the log that they came from."""
    return Log(
        path=name_locally(mission.files[0]),
        format="Parquet table",
        source=mission.inputs[0],
        sensors=tuple(result.samples for result in results),
    )
