"""A calibration and the samples of the sensor it belongs to."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from agonic.errors import AgonicError

if TYPE_CHECKING:
    from agonic.calibration.base import Calibration
    from agonic.logs.log import Log
    from agonic.samples import Samples


def calibration_and_samples(
    cal: Path, log: Path, sensor: str | None, unit: str | None
) -> tuple[Calibration, Samples]:
    """The calibration, and the log's sensor of that name, or the one asked for, or its only one.

    The samples come with the second magnetometer where the calibration mixes one, and each with
    the moment it was measured at where the calibration knows how late the readings are.
    """
    from agonic.calibration.chain import require_calibration
    from agonic.files.calibration import load
    from agonic.logs.read import open_log

    calibration, recording = require_calibration(load(cal)), open_log(log, unit=unit)
    names = [samples.name for samples in recording.sensors]
    if sensor is None and calibration.sensor not in names and len(names) > 1:
        raise AgonicError(
            f"{cal} is for sensor {calibration.sensor} and {log.name} holds {', '.join(names)}; "
            "choose one with --sensor"
        )
    if sensor is None:
        sensor = calibration.sensor if calibration.sensor in names else names[0]
    samples = beside_second(calibration, recording.sensor(sensor), recording)
    return calibration, on_time(calibration, samples)


def beside_second(calibration: Calibration, samples: Samples, log: Log) -> Samples:
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


def on_time(calibration: Calibration, samples: Samples) -> Samples:
    """The samples, each at the moment it was measured by the latency that the calibration knows."""
    from agonic.attitude.latency import undelayed

    late = getattr(calibration, "latency_s", 0.0)
    if not late or samples.time is None or len(samples) < 2:
        return samples
    return undelayed(samples, late)
