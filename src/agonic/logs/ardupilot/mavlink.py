"""The packets of a MAVLink telemetry log, `.tlog`, found and taken apart into columns.

A packet stands behind the moment of its arrival: microseconds since 1970, 8 bytes, big-endian. It
is of MAVLink 1 (mark FE) or 2 (mark FD) and ends with a checksum that knows its kind. Source:
MAVLink guide, "Packet Serialization"; the layouts of the messages are those of pymavlink.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Mask
from agonic.errors import MissingExtraError
from agonic.logs.ardupilot.dataflash_binary import Bytes, Index, find_chained, read_values

MARKS = (0xFE, 0xFD)
STAMP, HEADERS, CHECKSUM, SIGNATURE = 8, (6, 10), 2, 13
"""Bytes of the parts of a packet; a header of MAVLink 1 and of MAVLink 2."""

EARLIEST_US, LATEST_US = 946_684_800_000_000, 4_102_444_800_000_000  # years 2000 and 2100
_SIGNED = 1


@dataclass(frozen=True, eq=False)
class Packets:
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

    def __len__(self) -> int:
        return len(self.start)

    def select(self, rows: Mask) -> Packets:
        """The packets that a mask marks."""
        return Packets(*(getattr(self, column.name)[rows] for column in fields(self)))


@dataclass(frozen=True, eq=False)
class Messages:
    """All messages of one name, (n,) each: where it stood, who sent it, when it arrived, and its
    fields by name."""

    position: Index
    sender: Index
    received_s: Array
    values: NDArray[np.void]

    def __len__(self) -> int:
        return len(self.position)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the fields."""
        return self.values.dtype.names or ()

    def select(self, rows: Mask) -> Messages:
        """The messages that a mask marks."""
        return Messages(*(getattr(self, column.name)[rows] for column in fields(self)))


def find_packets(data: Bytes) -> Packets:
    """The packets in a file; what lies between them is passed over."""
    longest = STAMP + max(HEADERS)
    marks = data[STAMP : len(data) - longest + STAMP + 1]
    starts = np.flatnonzero((marks == MARKS[0]) | (marks == MARKS[1]))
    starts = starts[data[starts] == 0]
    time = read_values(data, starts, ">u8", 0).astype(np.int64)
    plausible = (time >= EARLIEST_US) & (time < LATEST_US)
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
    """The messages of one kind, without those whose checksum is wrong.

    What a packet leaves out is zero: MAVLink 2 cuts trailing zeros off, MAVLink 1 the extensions.
    """
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
    """What pymavlink knows of each message, by its name.

    Raises `MissingExtraError` without pymavlink.
    """
    try:
        from pymavlink.dialects.v20 import ardupilotmega
    except ImportError:
        raise MissingExtraError("reading MAVLink telemetry", "mavlink") from None
    return {message.msgname: message for message in ardupilotmega.mavlink_map.values()}
