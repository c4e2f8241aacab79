"""ROS 1 bags, ROS 2 bags (SQLite, MCAP) and single MCAP files, with rosbags.

Each topic with a magnetometer is a sensor. What IMUs, receivers, thermometers and batteries say is
brought to its times, vectors into its axes where `/tf_static` tells how. Readings stay in the axes
of the sensor, which are forward, left, up where it lies as REP-103 has it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
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
from agonic.logs.log import Log, Stream
from agonic.logs.ros.messages import (
    STAMP,
    TIME,
    TRANSFORMS,
    Row,
    find_reader,
    find_rotation,
    make_table,
    rotate_table,
)
from agonic.provenance import Input
from agonic.samples import Samples

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
