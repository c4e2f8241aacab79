"""Every magnetometer of a log calibrated; one that cannot be does not stop the others.

Of two of a vehicle, whether one thing disturbs both, and the mix that cancels it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.linalg import LinAlgError

from agonic.arrays import Array
from agonic.attitude.heading_source import with_course
from agonic.console.options import Place, ScalarChoice, SensorChoice
from agonic.console.parse import parse_mounting
from agonic.console.place import Beside, find_reference, open_beside_scalar
from agonic.console.progress import counting, progress, waiting
from agonic.console.sensors import open_sensors
from agonic.errors import AgonicError, CoverageError, TwoAxisError
from agonic.health import Finding, figure
from agonic.health.decoding import read_as
from agonic.logs.log import Log, allow_two_axes
from agonic.logs.remote import name_locally
from agonic.maths.one_pass import median
from agonic.recording.calibrated import (
    Calibrated,
    calibrate_as_named,
    calibrate_level,
    calibrate_recording,
)
from agonic.recording.choice.choose import SURER
from agonic.recording.mounting import calibrate, turn_back, turn_readings
from agonic.samples import Samples

TOGETHER = 0.6
"""Correlation of what two sensors leave, from which one thing disturbs both."""
STANDS_OUT = 2.0
"""Times that it must stand out of what the noise of the readings leaves in the mean of a second."""
BLOCK_S = 1.0
ATTITUDE = ("levelled", "inertial", "vector")
"""Methods by more than the magnitude."""


def report_pairs(results: Sequence[Calibrated]) -> list[Calibrated]:
    """The results, with a finding where one thing disturbs a sensor and another."""
    told = []
    for result in results:
        found = (compare(result, other) for other in results if other is not result)
        told.append(result.with_finding(*list(filter(None, found))[:1]))
    return told


def compare(result: Calibrated, other: Calibrated) -> Finding | None:
    """The finding that one thing disturbs both, from the correlation of what they leave.

    What is left of the magnitude is averaged over seconds, beyond which the noise of readings is
    small; opposite signs tell of a disturbance that the mean of the two cancels.
    """
    if result.samples.time is None or other.samples.time is None:
        return None
    time, beside = result.samples.time, other.samples.time
    both = time[(time >= beside[0]) & (time <= beside[-1])]  # each may be of a stretch
    left = [_average(one, both) for one in (result, other)] if len(both) else [None, None]
    if left[0] is None or left[1] is None or len(left[0]) < 8:
        return None
    correlation = float(np.corrcoef(left[0], left[1])[0, 1])
    if not abs(correlation) > TOGETHER:
        return None
    way = "opposite signs" if correlation < 0 else "equal signs"
    names = f"{result.samples.name} and {other.samples.name}"
    move = (
        "record the current that does it, or mix the two: agonic calibrate LOG --second auto"
        if correlation < 0
        else "look for a source equally near to both, a changing field or a wrong place; no mix of "
        "the two can separate it from the field"
    )
    said = f"{names} are disturbed together, with {way} (correlation {figure(correlation)})"
    return Finding("pair", "check", said, move)


def _average(one: Calibrated, time: Array) -> Array | None:
    """What a calibration leaves of the magnitude, means over seconds; none where it is noise."""
    fit, own = one.fit, one.samples.time
    if own is None or fit.calibration.magnitude is None:
        return None
    wanted = np.full(len(one.samples), fit.calibration.magnitude)
    if one.reference is not None and fit.calibration.unit_out == "nT":
        wanted = one.reference.magnitudes(len(one.samples))
    left = np.linalg.norm(one.corrected, axis=1) - wanted
    if not np.isfinite(left).all():  # a refused fit may be anything
        return None
    left = np.clip(left, *np.percentile(left, (0.5, 99.5)))
    at_rows = np.interp(time, own, left)
    block = np.floor((time - time[0]) / BLOCK_S).astype(int)
    rows = np.bincount(block)
    kept = rows > 0
    means = np.bincount(block, at_rows)[kept] / rows[kept]
    gain = float(np.trace(fit.calibration.matrix)) / 3
    noise = median(np.abs(np.diff(left))) / 0.6745 / np.sqrt(2)
    least = min(noise, fit.noise * gain) / np.sqrt(median(rows[kept]))
    return means if means.std() > STANDS_OUT * least else None


def take_mixes(
    results: Sequence[Calibrated], again: Callable[[Samples], Calibrated], chosen: str
) -> list[Calibrated]:
    """The results, each as a mix with another sensor where that is better."""
    taken = []
    for result in results:
        others = [one for one in results if one is not result]
        if chosen != "auto":
            others = [one for one in others if one.samples.name == chosen]
        mixes = [mixed for other in others if (mixed := _mix(result, other, again)) is not None]
        best = min(mixes, key=_rank, default=result)
        verdict, spread = _rank(result)  # the same verdict asks for clearly less spread
        better = _rank(best) < (verdict, SURER * spread)
        taken.append(best if chosen != "auto" or better else result)
    return taken


def _mix(
    result: Calibrated, other: Calibrated, again: Callable[[Samples], Calibrated]
) -> Calibrated | None:
    """A sensor calibrated as a mix with another; none where that cannot be had."""
    try:
        mixed = again(result.samples.with_second(other.samples))
    except AgonicError:
        return None
    before, after = result.verification.spread_after, mixed.verification.spread_after
    reason = (
        f"{other.samples.name} was mixed in, which takes the spread of unseen readings from "
        f"{before:.2%} to {after:.2%}"
    )
    return replace(mixed, reason=reason)


def _rank(one: Calibrated) -> tuple[int, float]:
    return ("good", "check", "refused").index(one.verdict), one.verification.spread_after


if TYPE_CHECKING:
    from agonic.logs.large.mission import Mission


def calibrate_each(
    log: Path,
    which: SensorChoice = SensorChoice(),
    between: str | None = None,
    method: str = "auto",
    *,
    place: Place = Place(),
    scalar: ScalarChoice = ScalarChoice(),
    course: bool = False,
    second: str | None = None,
    mounting: str | None = None,
    word: str | None = None,
) -> tuple[Log, list[Calibrated], list[tuple[str, str]]]:
    """The log, the sensors that could be fitted, and the names of others with the reason. `scalar`
    names a scalar magnetometer beside the sensors. With `course` the course over ground is taken
    for the heading. `second`: "auto" mixes in another sensor where that is better; a name, that
    one. `mounting`: where the axes of the sensor point. `word`: how numbers are to be read."""
    turn = None if mounting is None else parse_mounting(mounting)
    if turn is not None and second is not None:
        raise AgonicError("--mounting turns one sensor; mix in a second one (--second) without it")
    all_rows = {
        "--between": between,
        f"--method {method}": method in ATTITUDE,
        "--course": course,
        "--mounting": mounting,
        "--as": word,
        "--scalar": scalar.column,
    }
    long: tuple[Mission, ...] = ()
    with suppress(TwoAxisError):  # such a log is read whole
        long = open_missions(log, *which, all_rows)
    if long:
        jobs = [(one.head().name, partial(calibrate_mission, one, place)) for one in long]
        results, failures = _run(jobs)
        return make_log(long[0], results), results, failures
    with open_beside_scalar(scalar) as beside, allow_two_axes():
        only = None if second else which.sensor
        recording, sensors = open_sensors(log, only, which.unit, between)
    if any(samples.axes == "xy" for samples in sensors):
        named = {f"--method {method}": method != "auto", "--second": second, "--between": None}
        refuse_of_two_axes(log, all_rows | named)
    if word is not None:
        sensors = tuple(read_as(samples, word) for samples in sensors)
    if second not in (None, "auto"):
        recording.sensor(second)  # an error names those that there are
    run = partial(_calibrate, beside=beside, place=place, kind=method, course=course, turn=turn)
    results, failures = _run([(one.name, partial(run, one)) for one in sensors])
    if second is None:
        return recording, report_pairs(results), failures
    mixed = take_mixes(results, partial(_calibrate_mix, place=place), second)
    wanted = None if which.sensor is None else recording.sensor(which.sensor).name
    return recording, [r for r in mixed if wanted in (None, r.samples.name)], failures


def _calibrate(
    samples: Samples, *, beside: Beside, place: Place, kind: Any, course: bool, turn: Array | None
) -> Calibrated:
    """One sensor, by the field of the place and what was recorded beside it."""
    if course:
        samples = with_course(samples)
    reference, settings = find_reference(samples, *place)
    if samples.axes == "xy":
        return calibrate_level(samples, reference)
    given = place.at is not None or place.field is not None or kind in ATTITUDE
    samples, reference = beside.refer(samples, reference, given=given)
    if turn is None:
        return calibrate(samples, reference, kind=kind, **settings)
    turned = turn_readings(samples, turn)
    return turn_back(calibrate_as_named(turned, reference, kind=kind, **settings), turn)


def _calibrate_mix(samples: Samples, *, place: Place) -> Calibrated:
    """A sensor mixed with its second."""
    reference, settings = find_reference(samples, *place)
    if reference is None:
        raise AgonicError(
            "a mix of two magnetometers needs the field of the place: give --at LAT,LON or --field"
        )
    settings |= {"kind": "interference", "sources": ("second",)}
    return calibrate_as_named(samples, reference, **settings)


def refuse_of_two_axes(log: Path, given: Mapping[str, object]) -> None:
    """Raise `AgonicError` for options, by name, that say nothing of two axes and were given."""
    for option, value in given.items():
        if value:
            raise AgonicError(
                f"{log.name} holds a two-axis compass, x and y alone, for which {option} does not "
                "work; leave it out, or say with --columns which column is z"
            )


def _run(
    jobs: Sequence[tuple[str, Callable[[], Calibrated]]],
) -> tuple[list[Calibrated], list[tuple[str, str]]]:
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
            failures.append((name, f"the readings could not be processed ({why}): {move}"))
    return results, failures


def open_missions(
    log: Path, sensor: str | None, unit: str | None, all_rows: Mapping[str, str | bool | None]
) -> tuple[Mission, ...]:
    """One for each magnetometer of a table too long for memory; none where it is not. Nor where a
    column names the sensor row by row. `all_rows` are options that need all rows at once, with what
    was given, if anything."""
    from agonic.logs.large.mission import is_long, open_mission  # few logs are as long

    if not is_long([log]):
        return ()
    mission = open_mission([log], sensor=sensor, unit=unit)
    names = mission.sensors()
    given = [name for name, value in all_rows.items() if value]
    if names and given:
        raise AgonicError(
            f"{log.name} has {mission.rows} rows and is read piece by piece, by the magnitude "
            f"alone, without {', '.join(given)}; cut it, or leave those options out"
        )
    if sensor is not None:
        return (mission,) if names else ()
    return tuple(replace(mission, sensor=name) for name in names)


def calibrate_mission(mission: Mission, place: Place, **settings: Any) -> Calibrated:
    """The calibration of a mission, with the field of the place."""
    reference, of_place = find_reference(mission.head(), *place)
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
