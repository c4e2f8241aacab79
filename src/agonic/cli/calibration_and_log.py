"""A calibration and the samples of the sensor it belongs to."""

from __future__ import annotations

from pathlib import Path

from agonic.attitude.undo_latency import remove_delay
from agonic.calibration.base import Calibration
from agonic.calibration.steps import compose, require_calibration
from agonic.console.sensors import add_second, choose_name
from agonic.errors import UnitError
from agonic.files.calibration import load
from agonic.files.foreign import understand
from agonic.files.foreign_forms import is_foreign, read_foreign
from agonic.logs.read import open_log
from agonic.samples import Logged, Samples


def open_calibration_and_log(
    cal: Path, log: Path, sensor: str | None, unit: str | None
) -> tuple[Calibration, Samples]:
    """The calibration, and the log's sensor of that name, or the one asked for, or its only one.

    The samples come with the second magnetometer where the calibration mixes one, and each with
    the moment it was measured at where the calibration knows how late the readings are. One that
    another program made is read as the log shows that it is meant.
    """
    foreign = is_foreign(cal)
    calibration = None if foreign else require_calibration(load(cal))
    if foreign:
        read_foreign(cal)  # what it is not is the first thing to know
    recording = open_log(log, unit=unit)
    if calibration is None:
        names = (one.name for one in recording.sensors)
        samples = recording.sensor(choose_name(names) if sensor is None else sensor)
        return understand(cal, samples).calibration, samples
    if sensor is None:
        names = (samples.name for samples in recording.sensors)
        sensor = choose_name(names, calibration.sensor)
    samples = add_second(calibration, recording.sensor(sensor), recording)
    return calibration, remove_delay(calibration, samples)


def set_against(samples: Samples, old: Path) -> Samples:
    """The samples beside another calibration, also one of another program, to compare with."""
    foreign = is_foreign(old)
    one = understand(old, samples).calibration if foreign else require_calibration(load(old))
    whole = compose(one)
    if whole.unit_in != samples.unit:
        raise UnitError(
            f"{old.name} takes readings in {whole.unit_in} and {samples.name} is in {samples.unit}"
        )
    known = Logged(bias=whole.bias, matrix=whole.matrix, source=old.name)
    return samples.with_columns(logged=known)
