"""ROS 1 bags, ROS 2 bags (SQLite, MCAP) and single MCAP files, with rosbags.

Each topic with a magnetometer is a sensor. What IMUs, receivers, thermometers and batteries say is
brought to its times, vectors into its axes where `/tf_static` tells how. Readings stay in the axes
of the sensor, which are forward, left, up where it lies as REP-103 has it; an orientation turns
sensor axes into east, north, up. Columns have the names of the fields of messages.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import timedelta
from functools import cache
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.errors import LogError, MissingExtraError
from agonic.logs.contents import explain_damage
from agonic.logs.formats import METADATA
from agonic.logs.groups import build_groups_log
from agonic.logs.headers.columns import read_dialects
from agonic.logs.headers.header import name_quantity
from agonic.logs.log import Facts, Log, Stream
from agonic.logs.rows.tracks import SHORTEST_PULSE_US
from agonic.provenance import Input
from agonic.samples import Samples

Edges = Mapping[tuple[str, str], Rotation]
"""Rotations by (parent, child): they turn components in child axes into those of the parent."""


def find_rotation(edges: Edges, into: str, out_of: str) -> Rotation | None:
    """The rotation from components in one frame to another; `None` where none leads there."""
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
    if set(_QUATERNION) <= set(table):
        quat = np.stack([table[name] for name in _QUATERNION], axis=1)
        known = np.isfinite(quat).all(axis=1)
        turned = np.full_like(quat, np.nan)
        turned[known] = (Rotation.from_quat(quat[known]) * turn.inv()).as_quat()
        rotated |= dict(zip(_QUATERNION, turned.T, strict=True))
    return rotated


Row = dict[str, float]

STAMP = ("header.stamp.sec", "header.stamp.nanosec")


Getter = Callable[[Any], Any]
Field = tuple[tuple[str, ...], Getter, Getter | None, float, Getter | None]
"""Names of columns, what gets their values, all at once or of each item of a list, their sign, and
what gets the covariance that says whether there are any."""


@cache
def parse_fields(columns: str) -> tuple[Field, ...]:
    """The fields that a row of the table of dialects writes."""
    fields: list[Field] = []
    for column in columns.split():
        name, _, path = column.partition("=")
        stem, several, inner = path.lstrip("?-").partition("[]")
        axes = "xyz" if "*" in name else "*"
        names = tuple(name.replace("*", axis) for axis in axes)
        get = attrgetter(*(stem.replace("*", axis) for axis in axes))
        item: Getter | None = attrgetter(inner.lstrip(".")) if inner else float
        sign = -1.0 if path[0] == "-" else 1.0
        known = attrgetter(f"{stem.partition('.')[0]}_covariance") if path[0] == "?" else None
        fields.append((names, get, item if several else None, sign, known))
    return tuple(fields)


def read_message(message: Any, columns: str) -> Row:
    """What a message says, by a row of the table of dialects; nothing where a fix has none. A pulse
    that drives nothing is none."""
    if hasattr(message, "status") and message.status.status < 0:
        return {}
    said: dict[str, float] = {}
    for names, get, item, sign, covariance in parse_fields(columns):
        if covariance is not None and covariance(message)[0] == -1:
            continue
        values = get(message)
        if item is not None:
            said |= {names[0].format(k): float(item(v)) for k, v in enumerate(values, start=1)}
        elif len(names) > 1:
            said.update(zip(names, values, strict=True))
        else:
            said[names[0]] = sign * values
    if "_us" in columns:
        return {name: value for name, value in said.items() if value > SHORTEST_PULSE_US}
    return {} if math.isnan(said.get("current_A", 0.0)) else said


_QUATERNION = tuple(f"orientation_{axis}" for axis in "xyzw")
_TYPES: dict[str, str] = read_dialects()["ros"]["types"]
VECTOR, TIME = "geometry_msgs/msg/Vector3Stamped", "sensor_msgs/msg/TimeReference"
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")


def find_columns(topic: str, kind: str) -> str | None:
    """What the messages of a topic say; a plain vector where a magnetometer is named."""
    return None if kind == VECTOR and name_quantity(f"{topic}/x") != "field" else _TYPES.get(kind)


def make_table(rows: Iterable[Row]) -> dict[str, Array]:
    """The rows as columns, NaN where a message does not say; without what is the same in all. A
    quaternion of no length is none, nor is one that never changes, which nobody filled in."""
    every = list(rows)
    names = dict.fromkeys(chain.from_iterable(every))
    if all(len(row) == len(names) for row in every):  # as they mostly are
        values = np.array([tuple(row.values()) for row in every], dtype=np.float64).T.copy()
        table = dict(zip(names, values, strict=False))
    else:
        table = {name: np.array([row.get(name, np.nan) for row in every]) for name in names}
    turns = np.array([table[name] for name in _QUATERNION if name in table])
    if not len(turns):
        return table
    known = (turns**2).sum(axis=0) > 0.25  # nor where it is NaN
    if not known.any() or not np.ptp(turns[:, known], axis=1).any():
        return {name: values for name, values in table.items() if name not in _QUATERNION}
    return table | dict(zip(_QUATERNION, np.where(known, turns, np.nan), strict=True))


_FIELDS = ("magnetic_field_x", "mag_x")
"""A column of each kind of magnetometer."""


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
    """The log that a bag is; `unit` is that of the field where a driver did not keep to tesla."""
    contents = _Contents()
    with _open_bag(path) as bag:
        _read_messages(bag, contents)
    tables = {topic: make_table(rows) for topic, rows in contents.rows.items() if rows}
    fields = [topic for x in _FIELDS for topic, table in tables.items() if x in table]
    if not fields:
        there = ", ".join(s.name for s in contents.streams[:10]) or "no messages"
        raise LogError(
            f"no topic of sensor_msgs/MagneticField in it ({there}); record one, such as /imu/mag"
        )
    facts = Facts(path=path, source=source, format="ROS bag", unit=unit)
    sensors: list[Samples] = []
    failures: list[str] = []
    for topic in fields:
        try:
            sensors += _read_sensor(topic, tables, contents, facts)
        except LogError as error:
            failures.append(f"{topic}: {error}")
    if not sensors:
        raise LogError("; ".join(failures[:3]))
    damaged = (f"{contents.damaged} messages could not be read",) * (contents.damaged > 0)
    streams = [s for s in contents.streams if s.name not in fields]
    return Log.of(facts, sensors, streams, (*damaged, *failures))


@contextmanager
def _open_bag(path: Path) -> Iterator[Any]:
    """The bag as rosbags opens it; a file of a ROS 2 bag with the folder that it is in."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError("reading a ROS bag", "ros") from None
    whole = path
    if path.is_file() and path.suffix != ".bag" and (path.parent / METADATA).is_file():
        whole = path.parent
    elif path.suffix == ".db3":
        raise LogError(f"a ROS 2 bag is a folder: keep {METADATA} beside this file")
    with explain_damage("cannot be read as a ROS bag"):
        reader = AnyReader([whole], default_typestore=get_typestore(Stores.LATEST))
        reader.open()
    try:
        yield reader
    finally:
        reader.close()


def _read_messages(bag: Any, contents: _Contents) -> None:
    """Take what matters from the messages; one that is damaged is counted."""
    if bag.message_count > 2e7:
        raise LogError("more than 2e+07 messages; cut it (ros2 bag convert)")
    wanted: dict[tuple[int, str], str | None] = {}
    seconds = max((bag.end_time - bag.start_time) * 1e-9, 0.0)
    for connection in bag.connections:
        columns = find_columns(connection.topic, connection.msgtype)
        if columns is not None or connection.msgtype in (*TRANSFORMS, TIME):
            wanted[connection.id, connection.topic] = columns
        rows = connection.msgcount
        rate = rows / seconds if seconds else None
        contents.streams.append(Stream(name=connection.topic, rows=rows, rate_Hz=rate))
    chosen = [c for c in bag.connections if (c.id, c.topic) in wanted]
    for connection, received_ns, raw in bag.messages(connections=chosen) if chosen else ():
        columns = wanted[connection.id, connection.topic]
        try:
            message = bag.deserialize(raw, connection.msgtype)
            _take(message, connection, received_ns, columns or "", contents)
        except Exception:
            contents.damaged += 1


def _take(
    message: Any, connection: Any, received_ns: int, columns: str, contents: _Contents
) -> None:
    """Keep what one message says."""
    if connection.msgtype in TRANSFORMS:
        for one in message.transforms if connection.topic.endswith("tf_static") else ():
            q = one.transform.rotation
            edge = (_frame(one.header.frame_id), _frame(one.child_frame_id))
            contents.edges[edge] = Rotation.from_quat([q.x, q.y, q.z, q.w])
        return
    stamp = message.header.stamp
    if connection.msgtype == TIME:
        ahead = message.time_ref.sec - stamp.sec + (message.time_ref.nanosec - stamp.nanosec) * 1e-9
        if message.time_ref.sec > 0 and stamp.sec > 0:
            contents.ahead_s.append(ahead)
        return
    if not (said := read_message(message, columns)):
        return
    moment = stamp.sec, stamp.nanosec
    if moment == (0, 0):  # nobody filled it in: when it was recorded
        moment = divmod(received_ns, 1_000_000_000)
    when = {STAMP[0]: float(moment[0]), STAMP[1]: float(moment[1])}
    contents.rows.setdefault(connection.topic, []).append(when | said)
    contents.frames.setdefault(connection.topic, _frame(message.header.frame_id))


def _frame(name: str) -> str:
    return str(name).strip("/")


def _read_sensor(
    topic: str, tables: Mapping[str, Mapping[str, Array]], contents: _Contents, facts: Facts
) -> tuple[Samples, ...]:
    """One magnetometer with what was recorded beside it, in its axes."""
    here = contents.frames[topic]
    remarks = [f"axes of the frame {here!r}"] if here else []
    groups = {topic.strip("/"): dict(tables[topic])}
    for other, table in tables.items():
        if any(x in table for x in _FIELDS):
            continue
        groups[other.strip("/")] = dict(table)
        there = contents.frames[other]
        if here == there or not any(name.endswith("_x") for name in table):
            continue
        turn = find_rotation(contents.edges, here, there)
        if turn is None:
            remarks.append(
                f"no /tf_static leads from {there!r} of {other} to {here!r}: the two are taken as "
                "parallel"
            )
            continue
        if np.degrees(turn.magnitude()) > 1e-6:
            remarks.append(f"{other} was turned from {there!r} into {here!r} by /tf_static")
        groups[other.strip("/")] = rotate_table(table, turn)
    log = build_groups_log(groups, **(facts | {"remarks": tuple(remarks)}))
    return tuple(_set_clock(samples, contents.ahead_s) for samples in log.sensors)


def _set_clock(samples: Samples, ahead_s: list[float]) -> Samples:
    """The samples by the clock of a TimeReference, where that of the stamps is another."""
    if not ahead_s or samples.epoch is None:
        return samples
    shift = float(np.median(ahead_s))
    if abs(shift) < 1.0:
        return samples
    note = f"stamps are {shift:+.3f} s behind the time reference: the date follows the reference"
    epoch = samples.epoch + timedelta(seconds=shift)
    return replace(samples, epoch=epoch, notes=(*samples.notes, note))
