"""What ROS messages say, as columns under the names of their fields.

Units and axes are those of `sensor_msgs`: tesla, m/s², rad/s; forward, left, up; an orientation
that turns sensor axes into east, north, up (REP-103, REP-145). `conventions` knows the names.
Rotations between the frames of a robot are those of `/tf_static`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.logs.headers.header import identify_column

Edges = Mapping[tuple[str, str], Rotation]
"""Rotations by (parent, child): they turn components in child axes into those of the parent."""


def find_rotation(edges: Edges, into: str, out_of: str) -> Rotation | None:
    """The rotation from components in one frame to those in another; `None` where none leads there.

    >>> turn = Rotation.from_euler("z", 90, degrees=True)
    >>> edges = {("base", "imu"): turn, ("base", "mag"): turn * turn}
    >>> found = find_rotation(edges, "mag", "imu")
    >>> found.as_euler("ZYX", degrees=True).round(6)[0] + 0.0
    np.float64(-90.0)
    """
    steps: dict[str, dict[str, Rotation]] = {}
    for (parent, child), rotation in edges.items():
        steps.setdefault(child, {})[parent] = rotation
        steps.setdefault(parent, {})[child] = rotation.inv()
    reached = {out_of: Rotation.identity()}
    waiting = [out_of]
    while waiting:
        here = waiting.pop()
        for there, rotation in steps.get(here, {}).items():
            if there not in reached:
                reached[there] = rotation * reached[here]
                waiting.append(there)
    return reached.get(into)


def rotate_table(table: Mapping[str, Array], turn: Rotation) -> dict[str, Array]:
    """The columns of an IMU in the axes of another sensor; `turn` is from its axes to those."""
    rotated = dict(table)
    for stem in ("linear_acceleration", "angular_velocity"):
        names = [f"{stem}_{axis}" for axis in "xyz"]
        if set(names) <= set(table):
            values = turn.apply(np.stack([table[name] for name in names], axis=1))
            rotated |= dict(zip(names, values.T, strict=True))
    names = [f"orientation_{axis}" for axis in "xyzw"]
    if set(names) <= set(table):
        quat = np.stack([table[name] for name in names], axis=1)
        known = np.isfinite(quat).all(axis=1)
        turned = np.full_like(quat, np.nan)
        turned[known] = (Rotation.from_quat(quat[known]) * turn.inv()).as_quat()
        rotated |= dict(zip(names, turned.T, strict=True))
    return rotated


Row = Mapping[str, float]

_SHORTEST_PULSE_US = 800
STAMP = ("header.stamp.sec", "header.stamp.nanosec")


def _vector(stem: str, vector: Any) -> dict[str, float]:
    return {f"{stem}_{axis}": getattr(vector, axis) for axis in "xyz"}


def _read_field(message: Any) -> Row:
    return _vector("magnetic_field", message.magnetic_field)


def _read_imu(message: Any) -> Row:
    """Acceleration, rate and orientation; −1 first in a covariance means that there is none."""
    q = message.orientation
    parts: dict[str, float] = {}
    if message.linear_acceleration_covariance[0] != -1:
        parts |= _vector("linear_acceleration", message.linear_acceleration)
    if message.angular_velocity_covariance[0] != -1:
        parts |= _vector("angular_velocity", message.angular_velocity)
    if message.orientation_covariance[0] != -1 and q.w**2 + q.x**2 + q.y**2 + q.z**2 > 0.25:
        parts |= {f"orientation_{axis}": getattr(q, axis) for axis in "wxyz"}
    return parts


def _read_fix(message: Any) -> Row:
    """The place where there is a fix."""
    if message.status.status < 0:
        return {}
    place = ("latitude", "longitude", "altitude")
    return dict(
        zip(
            ("latitude_deg", "longitude_deg", "altitude_m"),
            (getattr(message, name) for name in place),
            strict=True,
        )
    )


def _read_battery(message: Any) -> Row:
    """The current drawn; ROS counts it negative."""
    return {} if math.isnan(message.current) else {"current_A": -message.current}


def _read_outputs(message: Any) -> Row:
    """Pulses to motors and servos, µs, as MAVROS passes them on."""
    pulses = enumerate(message.channels, start=1)
    return {f"output{k}_pwm_us": float(p) for k, p in pulses if p > _SHORTEST_PULSE_US}


def _read_speed_controllers(message: Any) -> Row:
    """The current that each speed controller draws."""
    return {f"esc{k}_A": float(e.current) for k, e in enumerate(message.esc_status, start=1)}


def _read_actuators(message: Any) -> Row:
    """Commands to motors, 0…1."""
    return {f"motor{k}_duty": float(x) for k, x in enumerate(message.normalized, start=1)}


READERS: dict[str, Callable[[Any], Row]] = {
    "sensor_msgs/msg/MagneticField": _read_field,
    "sensor_msgs/msg/Imu": _read_imu,
    "sensor_msgs/msg/NavSatFix": _read_fix,
    "sensor_msgs/msg/Temperature": lambda m: {"temperature_C": m.temperature},
    "sensor_msgs/msg/BatteryState": _read_battery,
    "mavros_msgs/msg/RCOut": _read_outputs,
    "mavros_msgs/msg/ESCStatus": _read_speed_controllers,
    "actuator_msgs/msg/Actuators": _read_actuators,
}
"""The types of messages that are read, and what each says."""

VECTOR, TIME = "geometry_msgs/msg/Vector3Stamped", "sensor_msgs/msg/TimeReference"
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")


def find_reader(topic: str, kind: str) -> Callable[[Any], Row] | None:
    """What reads the messages of a topic; a plain vector where a magnetometer is named."""
    column = identify_column(f"{topic}/x")
    if kind == VECTOR and column is not None and column.quantity.column == "field":
        return lambda message: _vector("mag", message.vector)
    return READERS.get(kind)


def make_table(rows: Iterable[Row]) -> dict[str, Array]:
    """The rows as columns, NaN where a message does not say; without what is the same in all.

    An orientation that never changes is one that nobody filled in.
    """
    every = list(rows)
    names = dict.fromkeys(name for row in every for name in row)
    table = {name: np.array([row.get(name, np.nan) for row in every]) for name in names}
    turns = [name for name in table if name.startswith("orientation_")]
    if turns and not any(np.nanmax(table[name]) > np.nanmin(table[name]) for name in turns):
        table = {name: values for name, values in table.items() if name not in turns}
    return table
