"""ROS 1 bags, ROS 2 bags (SQLite, MCAP) and single MCAP files, with rosbags.

Each topic with a magnetometer is a sensor. What IMUs, receivers, thermometers and batteries say is
brought to its times, vectors into its axes where `/tf_static` tells how. Readings stay in the axes
of the sensor, which are forward, left, up where it lies as REP-103 has it.

What ROS messages say, as columns under the names of their fields.

Units and axes are those of `sensor_msgs`: tesla, m/s², rad/s; forward, left, up; an orientation
that turns sensor axes into east, north, up (REP-103, REP-145). `conventions` knows the names.
Rotations between the frames of a robot are those of `/tf_static`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.errors import LogError, MissingExtraError
from agonic.logs.contents import explain_damage
from agonic.logs.groups import build_groups_log
from agonic.logs.headers.header import identify_column
from agonic.logs.log import Log, Stream
from agonic.provenance import Input
from agonic.samples import Samples

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


_METADATA = "metadata.yaml"
_CLOCKS_DIFFER_S = 1.0
_MOST_MESSAGES = 20_000_000


@dataclass
class _Contents:
    """What a bag says: rows and frame by topic, rotations, and other clock minus stamp, s."""

    rows: dict[str, list[Row]] = field(default_factory=dict)
    frames: dict[str, str] = field(default_factory=dict)
    edges: dict[tuple[str, str], Rotation] = field(default_factory=dict)
    ahead_s: list[float] = field(default_factory=list)
    streams: list[Stream] = field(default_factory=list)
    damaged: int = 0


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that a bag is; `unit` is that of the field where a driver did not keep to tesla.

    Raises `LogError` where it cannot be read or holds no magnetometer, `MissingExtraError` without
    rosbags.
    """
    contents = _Contents()
    with _open_bag(path) as bag:
        _read_messages(bag, contents)
    tables = {topic: make_table(rows) for topic, rows in contents.rows.items() if rows}
    fields = [topic for topic, table in tables.items() if "magnetic_field_x" in table]
    fields += [topic for topic, table in tables.items() if "mag_x" in table]
    if not fields:
        there = ", ".join(s.name for s in contents.streams[:10]) or "no messages"
        raise LogError(
            f"no topic of sensor_msgs/MagneticField in it ({there}); record one, such as /imu/mag"
        )
    sensors: list[Samples] = []
    failures: list[str] = []
    for topic in fields:
        try:
            sensors += _read_sensor(topic, tables, contents, path, source, unit)
        except LogError as error:
            failures.append(f"{topic}: {error}")
    if not sensors:
        raise LogError("; ".join(failures[:3]))
    damaged = (f"{contents.damaged} messages could not be read",) * (contents.damaged > 0)
    return Log(
        path=path,
        format="ROS bag",
        source=source,
        sensors=tuple(sensors),
        streams=tuple(s for s in contents.streams if s.name not in fields),
        notes=(*damaged, *failures),
    )


@contextmanager
def _open_bag(path: Path) -> Iterator[Any]:
    """The bag as rosbags opens it; a file of a ROS 2 bag with the folder that it is in."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError("reading a ROS bag", "ros") from None
    whole = path
    if path.is_file() and path.suffix != ".bag" and (path.parent / _METADATA).is_file():
        whole = path.parent
    elif path.suffix == ".db3":
        raise LogError(f"a ROS 2 bag is a folder: keep {_METADATA} beside this file")
    with explain_damage("cannot be read as a ROS bag"):
        reader = AnyReader([whole], default_typestore=get_typestore(Stores.LATEST))
        reader.open()
    try:
        yield reader
    finally:
        reader.close()


def _read_messages(bag: Any, contents: _Contents) -> None:
    """Take what matters from the messages; one that is damaged is counted."""
    if bag.message_count > _MOST_MESSAGES:
        raise LogError(f"more than {_MOST_MESSAGES:g} messages; cut it (ros2 bag convert)")
    readers = {}
    seconds = max((bag.end_time - bag.start_time) * 1e-9, 0.0)
    for connection in bag.connections:
        reader = find_reader(connection.topic, connection.msgtype)
        if reader is not None or connection.msgtype in (*TRANSFORMS, TIME):
            readers[connection.id, connection.topic] = reader
        rate = connection.msgcount / seconds if seconds else None
        contents.streams.append(
            Stream(name=connection.topic, rows=connection.msgcount, rate_Hz=rate)
        )
    wanted = [c for c in bag.connections if (c.id, c.topic) in readers]
    if not wanted:
        return
    for connection, received_ns, raw in bag.messages(connections=wanted):
        try:
            message = bag.deserialize(raw, connection.msgtype)
            _take(
                message, connection, received_ns, readers[connection.id, connection.topic], contents
            )
        except Exception:
            contents.damaged += 1


def _take(
    message: Any, connection: Any, received_ns: int, reader: Any, contents: _Contents
) -> None:
    """Keep what one message says."""
    if connection.msgtype in TRANSFORMS:
        if connection.topic.endswith("tf_static"):
            for told in message.transforms:
                q = told.transform.rotation
                edge = (_frame(told.header.frame_id), _frame(told.child_frame_id))
                contents.edges[edge] = Rotation.from_quat([q.x, q.y, q.z, q.w])
        return
    stamp = message.header.stamp
    if connection.msgtype == TIME:
        ahead = message.time_ref.sec - stamp.sec + (message.time_ref.nanosec - stamp.nanosec) * 1e-9
        if message.time_ref.sec > 0 and stamp.sec > 0:
            contents.ahead_s.append(ahead)
        return
    said = reader(message)
    if not said:
        return
    if stamp.sec == 0 and stamp.nanosec == 0:  # nobody filled it in: when it was recorded
        second, nanosecond = divmod(received_ns, 1_000_000_000)
    else:
        second, nanosecond = stamp.sec, stamp.nanosec
    when = dict(zip(STAMP, (float(second), float(nanosecond)), strict=True))
    contents.rows.setdefault(connection.topic, []).append({**when, **said})
    contents.frames.setdefault(connection.topic, _frame(message.header.frame_id))


def _frame(name: str) -> str:
    return str(name).strip("/")


def _read_sensor(
    topic: str,
    tables: Mapping[str, Mapping[str, Array]],
    contents: _Contents,
    path: Path,
    source: Input,
    unit: str | None,
) -> tuple[Samples, ...]:
    """One magnetometer with what was recorded beside it."""
    notes: list[str] = []
    groups = {topic.strip("/"): dict(tables[topic])}
    for other, table in tables.items():
        if "magnetic_field_x" in table or "mag_x" in table:
            continue
        groups[other.strip("/")] = _turn(other, topic, table, contents, notes)
    remarks = (f"axes of the frame {contents.frames[topic]!r}",) if contents.frames[topic] else ()
    log = build_groups_log(
        groups, path=path, source=source, format="ROS bag", unit=unit, remarks=(*remarks, *notes)
    )
    return tuple(_set_clock(samples, contents.ahead_s) for samples in log.sensors)


def _turn(
    other: str,
    topic: str,
    table: Mapping[str, Array],
    contents: _Contents,
    notes: list[str],
) -> dict[str, Array]:
    """The columns of another topic in the axes of a magnetometer."""
    here, there = contents.frames[topic], contents.frames[other]
    vectors = any(name.endswith("_x") for name in table)
    if here == there or not vectors:
        return dict(table)
    turn = find_rotation(contents.edges, here, there)
    if turn is None:
        notes.append(
            f"no /tf_static leads from {there!r} of {other} to {here!r}: the two are taken as "
            "parallel"
        )
        return dict(table)
    if np.degrees(turn.magnitude()) > 1e-6:
        notes.append(f"{other} was turned from {there!r} into {here!r} by /tf_static")
    return rotate_table(table, turn)


def _set_clock(samples: Samples, ahead_s: list[float]) -> Samples:
    """The samples by the clock of a TimeReference, where that of the stamps is another."""
    if not ahead_s or samples.epoch is None:
        return samples
    shift = float(np.median(ahead_s))
    if abs(shift) < _CLOCKS_DIFFER_S:
        return samples
    note = f"stamps are {shift:+.3f} s behind the time reference: the date follows the reference"
    epoch = samples.epoch + timedelta(seconds=shift)
    return replace(samples, epoch=epoch, notes=(*samples.notes, note))
