"""A calibration and the samples of the sensor it belongs to."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from agonic.errors import AgonicError

if TYPE_CHECKING:
    from agonic.calibration.base import Calibration
    from agonic.samples import Samples


def calibration_and_samples(
    cal: Path, log: Path, sensor: str | None, unit: str | None
) -> tuple[Calibration, Samples]:
    """The calibration, and the log's sensor of that name, or the one asked for, or its only one."""
    from agonic.io.calfile import load, require_calibration
    from agonic.io.read import open_log

    calibration, recording = require_calibration(load(cal)), open_log(log, unit=unit)
    names = [samples.name for samples in recording.sensors]
    if sensor is None and calibration.sensor not in names and len(names) > 1:
        raise AgonicError(
            f"{cal} is for sensor {calibration.sensor} and {log.name} holds {', '.join(names)}; "
            "choose one with --sensor"
        )
    if sensor is None:
        sensor = calibration.sensor if calibration.sensor in names else names[0]
    return calibration, recording.sensor(sensor)
