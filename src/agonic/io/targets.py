"""`TARGETS`: every program that a calibration can be written for, by name."""

from __future__ import annotations

from collections.abc import Callable

from agonic.io.export import Export
from agonic.io.write_ardupilot import write_ardupilot
from agonic.io.write_c import write_c
from agonic.io.write_matlab import write_matlab
from agonic.io.write_motioncal import write_motioncal
from agonic.io.write_px4 import write_px4
from agonic.io.write_ros import write_ros
from agonic.io.write_table import write_table

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
