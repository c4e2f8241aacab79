"""The parameters in which autopilots keep the calibration of a compass, by name."""

from __future__ import annotations

from typing import NamedTuple


class Autopilot(NamedTuple):
    """How its parameters are called, what they are of (offset, diagonal, off-diagonal, motors) and
    for which compasses, in order; the unit of an offset, and the convention."""

    name: str
    parts: tuple[str, str, str, str]
    slots: tuple[str, ...]
    unit: str
    convention: str

    def names(self, number: int, *parts: str) -> list[str]:
        """Those of x, y and z of each part, of the compass of a number, from 1."""
        slot = self.slots[number - 1]
        return [self.name.format(part=p, slot=slot, axis=axis) for p in parts for axis in "XYZ"]


ARDUPILOT = Autopilot(
    "COMPASS_{part}{slot}_{axis}",
    ("OFS", "DIA", "ODI", "MOT"),
    ("", "2", "3"),
    "mG",
    "A (raw + b)",
)
"""Source: ArduPilot, AP_Compass_Backend.cpp."""
PX4 = Autopilot(
    "CAL_MAG{slot}_{axis}{part}",
    ("OFF", "SCALE", "ODIAG", "COMP"),
    ("0", "1", "2", "3"),
    "G",
    "A (raw − b)",
)
"""Source: PX4, sensor_calibration/Magnetometer.hpp."""
