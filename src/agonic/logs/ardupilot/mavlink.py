"""The packets of a MAVLink telemetry log, `.tlog`, found and taken apart into columns, and what
they say as the tables of a dataflash log, on the vehicle's clock.

A packet stands behind the moment of its arrival: microseconds since 1970, 8 bytes, big-endian. It
is of MAVLink 1 (mark FE) or 2 (mark FD) and ends with a checksum that knows its kind. Source:
MAVLink guide, "Packet Serialization"; the layouts of the messages are those of pymavlink.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import partial
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index, Mask
from agonic.errors import MissingExtraError
from agonic.logs.ardupilot.dataflash_binary import Bytes, find_chained, read_values
from agonic.logs.clocks.clock import UNIX
from agonic.logs.headers.columns import read_dialects
from agonic.logs.rows.tracks import LONGEST_RUN_S, Table

MARKS = (0xFE, 0xFD)
STAMP, HEADERS, CHECKSUM, SIGNATURE = 8, (6, 10), 2, 13
"""Bytes of the parts of a packet; a header of MAVLink 1 and of MAVLink 2."""

_SIGNED = 1


class _Rows:
    """Columns of one length, the first of them `Index` or `Array`."""

    def __len__(self) -> int:
        return len(next(iter(vars(self).values())))

    def select(self, rows: Mask) -> Self:
        """The rows that a mask marks."""
        return type(self)(*(column[rows] for column in vars(self).values()))


@dataclass(frozen=True, eq=False)
class Packets(_Rows):
    """Packets in the order of the file, (n,) each: the places of stamp, payload and end, the bytes
    of payload, the number of the message, who sent it (system · 256 + component), and when it
    arrived."""

    start: Index
    payload: Index
    length: Index
    end: Index
    kind: Index
    sender: Index
    received_us: Index


@dataclass(frozen=True, eq=False)
class Messages(_Rows):
    """All messages of one name, (n,) each: where it stood, who sent it, when it arrived, and its
    fields by name."""

    position: Index
    sender: Index
    received_s: Array
    values: NDArray[np.void]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the fields."""
        return self.values.dtype.names or ()


def find_packets(data: Bytes) -> Packets:
    """The packets in a file; what lies between them is passed over."""
    longest = STAMP + max(HEADERS)
    marks = data[STAMP : len(data) - longest + STAMP + 1]
    starts = np.flatnonzero((marks == MARKS[0]) | (marks == MARKS[1]))
    starts = starts[data[starts] == 0]
    time = read_values(data, starts, ">u8", 0).astype(np.int64)
    # years 2000 to 2100
    plausible = (time >= 946_684_800_000_000) & (time < 4_102_444_800_000_000)
    starts, time = starts[plausible], time[plausible]
    byte = partial(read_values, data, starts)
    second = byte("u1", STAMP) == MARKS[1]
    length = byte("u1", STAMP + 1).astype(np.int64)
    payload = starts + STAMP + np.where(second, HEADERS[1], HEADERS[0])
    signed = second & (byte("u1", STAMP + 2) & _SIGNED == 1)
    end = payload + length + CHECKSUM + np.where(signed, SIGNATURE, 0)
    kind = np.where(second, byte("<u4", STAMP + 6) >> 8, byte("u1", STAMP + 5)).astype(np.int64)
    sender = np.where(second, byte(">u2", STAMP + 5), byte(">u2", STAMP + 3)).astype(np.int64)
    columns = starts, payload, length, end, kind, sender, time
    return Packets(*columns).select(find_chained(starts, end, len(data)))


def decode(data: Bytes, packets: Packets, message: Any) -> Messages:
    """The messages of one kind, without those whose checksum is wrong. What a packet leaves out is
    zero: MAVLink 2 cuts trailing zeros off, MAVLink 1 the extensions."""
    packets = packets.select(check_intact(data, packets, message.crc_extra))
    layout = make_dtype(message)
    column = np.arange(layout.itemsize)
    place = np.minimum(packets.payload[:, None] + column, len(data) - 1)
    payload = np.where(column < packets.length[:, None], data[place], np.uint8(0))
    values = np.ascontiguousarray(payload).view(layout)[:, 0]
    return Messages(packets.start, packets.sender, packets.received_us / 1e6, values)


def check_intact(data: Bytes, packets: Packets, extra: int) -> Mask:
    """Whether the checksums are right: CRC-16/MCRF4XX of all behind the mark, and of `extra`."""
    first = packets.start + STAMP + 1
    size = packets.payload + packets.length - first
    crc = np.full(len(packets), 0xFFFF, np.uint16)
    for k in range(int(size.max(initial=0))):
        rows = np.flatnonzero(size > k)
        crc[rows] = _accumulate(crc[rows], data[first[rows] + k])
    crc = _accumulate(crc, np.uint8(extra))
    return np.asarray(crc == read_values(data, first + size, "<u2", 0))


def _accumulate(crc: NDArray[np.uint16], byte: Bytes | np.uint8) -> NDArray[np.uint16]:
    """One byte more, as `crc_accumulate` in checksum.h of the MAVLink C library."""
    low = np.bitwise_xor(byte, crc.astype(np.uint8))
    low ^= low << 4
    wide = low.astype(np.uint16)
    return np.asarray((crc >> 8) ^ (wide << 8) ^ (wide << 3) ^ (wide >> 4))


def make_dtype(message: Any) -> np.dtype[np.void]:
    """The layout of a payload, without padding."""
    letters = message.native_format.decode()[1:]
    described = zip(message.ordered_fieldnames, letters, message.array_lengths, strict=True)
    return np.dtype(
        [
            (name, f"S{max(n, 1)}") if letter == "c" else (name, f"<{letter}", (n,) if n else ())
            for name, letter, n in described
        ]
    )


def load_definitions() -> dict[str, Any]:
    """What pymavlink knows of each message, by its name."""
    try:
        from pymavlink.dialects.v20 import ardupilotmega
    except ImportError:
        raise MissingExtraError("reading MAVLink telemetry", "mavlink") from None
    return {message.msgname: message for message in ardupilotmega.mavlink_map.values()}


_TELEMETRY = read_dialects()["telemetry"]
READINGS: tuple[str, ...] = tuple(_TELEMETRY["readings"].split())
"""Messages with a magnetometer, in mG, m/s² and rad/s; their tables keep the names."""
CLOCKED = tuple(_TELEMETRY["clocked"].split())
"""Messages that carry `time_boot_ms`."""


def _read_columns(columns: Iterable[str]) -> Iterator[tuple[str, tuple[str, float]]]:
    """The name of each column, and the field and the factor that it is, an asterisk for each axis
    in turn."""
    for column in columns:
        ours, _, theirs = column.partition("=")
        field, _, factor = theirs.partition(":")
        for axis in "xyz" if "*" in ours else "*":
            yield ours.replace("*", axis.upper()), (field.replace("*", axis), float(factor or 1))


TABLES: dict[str, tuple[str, dict[str, tuple[str, float]]]] = {
    message: (table, dict(_read_columns(columns)))
    for message, (table, *columns) in ((n, t.split()) for n, t in _TELEMETRY["tables"].items())
}
"""The table that the messages of each name become, and its columns: fields, and factors of them."""

_LONGEST_DELAY_S = 60.0
"""A clock that goes back by more was started anew; one that differs by more is another."""


@dataclass(frozen=True, eq=False)
class Timeline:
    """The clock of the vehicle as its messages show it, in the order of the file. `boot_s` are
    seconds since its start; where it starts anew, they run on. Where no message shows it,
    `position` is empty, and second zero is the first arrival."""

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
        wrap_s = 2**32 / 1e6  # it was once a number of 32 bits
        unwrapped = own + wrap_s * np.round((boot - own) / wrap_s)
        usable = (own < LONGEST_RUN_S) & (np.abs(unwrapped - boot) < _LONGEST_DELAY_S)
        return np.where(usable, unwrapped, seconds)


def make_tables(heard: Mapping[str, Messages], timeline: Timeline) -> dict[str, Table]:
    """The messages as tables, each with its time on the clock of the vehicle."""
    tables = {}
    for name, (table, columns) in TABLES.items():
        messages = heard[name]
        if "current_battery" in messages.names:  # without those that nothing measures it
            messages = messages.select(messages.values["current_battery"] != -1)
        elif "fields_updated" in messages.names:  # of the magnetometer
            messages = messages.select(messages.values["fields_updated"] & (0b111 << 6) > 0)
        values: dict[str, NDArray[Any]] = {"TimeUS": timeline.seconds(messages) * 1e6}
        for column, (field, factor) in columns.items():
            found = messages.values[field]
            values[column] = found if found.dtype.kind == "S" else found.astype(float) * factor
        if len(messages):
            tables[table] = Table(messages.position, values)
    return tables
