"""`TARGETS`: every program that a calibration can be written for, by name."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from agonic.calibration.base import Calibration
from agonic.errors import check_choice
from agonic.exports.ardupilot import write_ardupilot
from agonic.exports.c_header import write_c
from agonic.exports.convert import Export
from agonic.exports.matlab import write_matlab
from agonic.exports.motioncal import write_motioncal
from agonic.exports.px4 import write_px4
from agonic.exports.ros import write_ros
from agonic.exports.table import write_table

TARGETS: dict[str, Callable[..., Export]] = {
    "ardupilot": write_ardupilot,
    "c": write_c,
    "matlab": write_matlab,
    "motioncal": write_motioncal,
    "px4": write_px4,
    "ros": write_ros,
    "table": write_table,
}

SUFFIXES: dict[str, str] = {
    "ardupilot": ".param",
    "c": ".h",
    "matlab": ".mat",
    "motioncal": ".bin",
    "px4": ".params",
    "ros": ".yaml",
    "table": ".csv",
}
"""The ending of a target's files."""


def write(
    target: str,
    calibration: Calibration,
    path: Path | str,
    *,
    number: int | None = None,
    device_id: int | None = None,
    temperature_C: float | None = None,
) -> Export:
    """Write a calibration for a target, for the vehicle's compass of that number, from 1.

    `temperature_C` is where one that changes with temperature is held: it must be given for a
    target that knows no temperature. The number is that of the sensor's name and the device id the
    calibration's own, unless given.
    """
    check_choice("target", target, tuple(TARGETS))
    which = compass_number(calibration.sensor) if number is None else number
    device = getattr(calibration, "device_id", None) if device_id is None else device_id
    options: dict[str, dict[str, int | None]] = {
        "ardupilot": {"compass": which},
        "px4": {"slot": which - 1, "device_id": device},
    }
    return TARGETS[target](
        calibration, path, temperature_C=temperature_C, **options.get(target, {})
    )


def compass_number(sensor: str) -> int:
    """Which compass of its vehicle a sensor's name means, from 1.

    >>> [compass_number(s) for s in ("MAG", "MAG2", "MAG[1]", "sensor_mag[0]", "SCALED_IMU3")]
    [1, 2, 2, 1, 3]
    """
    if found := re.search(r"\[(\d+)\]$", sensor):
        return int(found[1]) + 1
    found = re.search(r"(\d)$", sensor)
    return max(int(found[1]), 1) if found else 1
