"""The sensors of a log that a command is about."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from agonic.console.progress import waiting
from agonic.errors import AgonicError, LogError

if TYPE_CHECKING:
    from agonic.calibration.base import Calibration
    from agonic.logs.log import Log
    from agonic.samples import Samples

T = TypeVar("T")


def open_sensors(
    path: Path, sensor: str | None, unit: str | None, between: str | None = None
) -> tuple[Log, tuple[Samples, ...]]:
    """A log, and the sensor that was asked for or all of them, whole or an interval of it."""
    from agonic.logs.read import open_log

    with (
        waiting(f"Reading {path.name}")
        if (path.is_file() and path.stat().st_size > 5_000_000)
        else nullcontext()
    ):
        log = open_log(path, unit=unit)
    sensors = log.sensors if sensor is None else (log.sensor(sensor),)
    return log, tuple(select_between(samples, between) for samples in sensors)


def open_sensor(
    path: Path,
    sensor: str | None,
    unit: str | None,
    between: str | None = None,
    *,
    preferred: str = "",
    needed: str = "",
) -> Samples:
    """The sensor of a log that was asked for, or the preferred one, or its only one. `needed` is
    what the command reads, which is told where the file holds no magnetometer."""
    try:
        _, sensors = open_sensors(path, sensor, unit, between)
    except LogError as error:
        if not needed:
            raise
        said = str(error).removeprefix(f"{path}: ")
        raise LogError(f"{said}; {needed}", path=path) from error
    name = choose_name((samples.name for samples in sensors), preferred)
    return next(samples for samples in sensors if samples.name == name)


def choose_name(names: Iterable[T], preferred: object = "") -> T:
    """The preferred name, or the only one."""
    known = list(names)
    if same := [name for name in known if name == preferred]:
        return same[0]
    if len(known) > 1:
        without = f" and not {preferred}" if preferred else ""
        listed = ", ".join(map(str, known))
        raise AgonicError(f"the log holds {listed}{without}; choose one with --sensor")
    return known[0]


def select_between(samples: Samples, between: str | None) -> Samples:
    """The readings between two moments of "START,STOP", seconds by the clock of the log."""
    from agonic.console.parse import parse_numbers

    if between is None:
        return samples
    start, stop = parse_numbers("--between", between, "START,STOP in seconds")
    if samples.time is None:
        raise AgonicError(f"--between needs times and {samples.name} was logged without")
    rows = (samples.time >= start) & (samples.time <= stop)
    if not rows.any():
        first, last = samples.time[[0, -1]]
        raise AgonicError(
            f"--between {between} holds no reading of {samples.name}: by the clock of the log "
            f"(time_s) they lie between {first:.1f} s and {last:.1f} s"
        )
    return samples.select(rows)


def add_second(calibration: Calibration, samples: Samples, log: Log) -> Samples:
    """The samples beside the second magnetometer of the log that the calibration mixes, if any."""
    if "second" not in calibration.needs or samples.second is not None:
        return samples
    name = getattr(calibration, "second_sensor", None)
    if name is None:
        raise AgonicError(
            f"the calibration of {calibration.sensor} mixes a second magnetometer and its file "
            "does not say which; fit it again with --second"
        )
    names = [one.name for one in log.sensors]
    if name not in names:
        raise AgonicError(
            f"the calibration of {calibration.sensor} mixes the readings of {name} and "
            f"{log.path.name} holds {', '.join(names)}; both are needed"
        )
    return samples.with_second(log.sensor(name))
