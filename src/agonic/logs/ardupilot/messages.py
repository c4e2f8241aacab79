"""What MAVLink messages say, in the tables of a dataflash log and on the vehicle's clock.

Names, units and invalid values: MAVLink, message_definitions/v1.0/common.xml.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.logs.ardupilot.dataflash_binary import Index, Table
from agonic.logs.ardupilot.mavlink import Messages
from agonic.logs.clocks.clock import UNIX
from agonic.units import STANDARD_GRAVITY_M_S2

Columns = Mapping[str, tuple[str, float]]
"""For each column of a table the field of the message and the factor between their units."""


def _vectors(acceleration: float, rate: float, field: float) -> Columns:
    factors = {("Acc", "acc"): acceleration, ("Gyr", "gyro"): rate, ("Mag", "mag"): field}
    return {
        stem + axis.upper(): (axis + name, factor)
        for (stem, name), factor in factors.items()
        for axis in "xyz"
    }


_TURN, _MILLI = 180 / np.pi, 1e-3
_PLACE = {"Lat": ("lat", 1e-7), "Lng": ("lon", 1e-7), "Alt": ("alt", _MILLI)}
_SCALED = _vectors(STANDARD_GRAVITY_M_S2 * _MILLI, _MILLI, 1.0)

INERTIAL: dict[str, Columns] = {
    "HIGHRES_IMU": _vectors(1.0, 1.0, 1e3),
    "RAW_IMU": _SCALED,
    "SCALED_IMU": _SCALED,
    "SCALED_IMU2": _SCALED,
    "SCALED_IMU3": _SCALED,
}
"""Messages with a magnetometer, in mG, m/s² and rad/s; their tables keep the names."""

TABLES: dict[str, tuple[str, Columns]] = {
    "PARAM_VALUE": (
        "PARM",
        {
            "Name": ("param_id", 1.0),
            "Value": ("param_value", 1.0),
            "Count": ("param_count", 1.0),
        },
    ),
    "STATUSTEXT": ("MSG", {"Message": ("text", 1.0)}),
    "ATTITUDE": ("ATT", {n: (n.lower(), _TURN) for n in ("Roll", "Pitch", "Yaw")}),
    "GPS_RAW_INT": ("GPS", {**_PLACE, "Status": ("fix_type", 1.0)}),
    "GLOBAL_POSITION_INT": ("POS", _PLACE),
    "BATTERY_STATUS": ("BAT", {"Instance": ("id", 1.0), "Curr": ("current_battery", 0.01)}),
    "SYS_STATUS": ("CURR", {"Curr": ("current_battery", 0.01)}),
    "SERVO_OUTPUT_RAW": ("RCOU", {f"C{k}": (f"servo{k}_raw", 1.0) for k in range(1, 9)}),
    "VFR_HUD": ("CTUN", {"ThO": ("throttle", 0.01)}),
    **{name: (name, columns) for name, columns in INERTIAL.items()},
}
"""The table that the messages of each name become."""

CLOCKED = ("ATTITUDE", "GLOBAL_POSITION_INT", "SCALED_IMU2", "SCALED_IMU3", "SYSTEM_TIME")
"""Messages that carry `time_boot_ms`."""

_NOT_MEASURED = -1  # as current_battery
_NEW_READING = 0b111 << 6  # of the magnetometer, in fields_updated
_WRAP_S = 2**32 / 1e6  # ArduPilot's time_usec was once a number of 32 bits
_LONGEST_RUN_S = 1e8  # three years; what lies above counts from 1970
_LONGEST_DELAY_S = 60.0
"""A clock that goes back by more was started anew; one that differs by more is another."""


@dataclass(frozen=True, eq=False)
class Timeline:
    """The clock of the vehicle as its messages show it, in the order of the file.

    `boot_s` are seconds since its start; where it starts anew, they run on. Where no message shows
    it, `position` is empty, and second zero is the first arrival.
    """

    position: Index
    boot_s: Array
    received_s: Array

    @classmethod
    def of(cls, heard: Mapping[str, Messages]) -> Timeline:
        """The clock that these messages show."""
        clocked = [m.select(m.values["time_boot_ms"] > 0) for m in (heard[n] for n in CLOCKED)]
        position = np.concatenate([m.position for m in clocked])
        if not len(position):
            first = min((m.received_s[0] for m in heard.values() if len(m)), default=0.0)
            return cls(position, np.zeros(1), np.full(1, first))
        order = np.argsort(position)
        received = np.concatenate([m.received_s for m in clocked])[order]
        boot = np.concatenate([m.values["time_boot_ms"] for m in clocked])[order] / 1e3
        step, passed = np.diff(boot, prepend=boot[0]), np.diff(received, prepend=received[0])
        lost = np.where(step < -_LONGEST_DELAY_S, np.maximum(passed, 0.0) - step, 0.0)
        return cls(position[order], boot + np.cumsum(lost), received)

    @property
    def epoch(self) -> datetime:
        """The UTC moment of second zero, by the clock of the ground station."""
        return UNIX + timedelta(seconds=float(np.median(self.received_s - self.boot_s)))

    def seconds(self, messages: Messages) -> Array:
        """When messages were sent, if they tell; else by their arrival after one that does."""
        latest = np.maximum(np.searchsorted(self.position, messages.position, side="right") - 1, 0)
        boot = self.boot_s[latest]
        seconds = boot + (messages.received_s - self.received_s[latest])
        if "time_usec" not in messages.names or not len(self.position):
            return seconds
        own = messages.values["time_usec"] / 1e6
        unwrapped = own + _WRAP_S * np.round((boot - own) / _WRAP_S)
        usable = (own < _LONGEST_RUN_S) & (np.abs(unwrapped - boot) < _LONGEST_DELAY_S)
        return np.where(usable, unwrapped, seconds)


def make_tables(heard: Mapping[str, Messages], timeline: Timeline) -> dict[str, Table]:
    """The messages as tables, each with its time on the clock of the vehicle."""
    tables = {}
    for name, (table, columns) in TABLES.items():
        messages = _keep_informative(heard[name])
        values: dict[str, NDArray[Any]] = {"TimeUS": timeline.seconds(messages) * 1e6}
        for column, (field, factor) in columns.items():
            found = messages.values[field]
            values[column] = found if found.dtype.kind == "S" else found.astype(float) * factor
        if len(messages):
            tables[table] = Table(messages.position, values)
    return tables


def _keep_informative(messages: Messages) -> Messages:
    """The messages without those that repeat a reading or say that nothing measures it."""
    if "current_battery" in messages.names:
        return messages.select(messages.values["current_battery"] != _NOT_MEASURED)
    if "fields_updated" in messages.names:
        return messages.select((messages.values["fields_updated"] & _NEW_READING) > 0)
    return messages
