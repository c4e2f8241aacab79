"""Synthetic PX4 logs: the ULog format as docs.px4.io describes it, topics as given."""

from __future__ import annotations

import struct

import numpy as np

TYPES = {
    "u8": "uint64_t",
    "u4": "uint32_t",
    "u1": "uint8_t",
    "i4": "int32_t",
    "i8": "int64_t",
    "f4": "float",
    "f8": "double",
    "b1": "bool",
}

Topic = dict[str, np.ndarray]


def ulog(
    topics: dict[str, Topic],
    parameters: dict[str, float] | None = None,
    info: dict[str, int] | None = None,
) -> bytes:
    """The bytes of a log; topics by name with instance, "sensor_mag[1]"; (n, k) columns are arrays.

    Whole-number parameters are written as int32, others as float, as PX4 does.
    """
    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1), _message("B", bytes(40))]
    for key, number in (info or {}).items():
        parts.append(_message("I", _keyed(f"uint32_t {key}", struct.pack("<I", number))))
    for name, topic in topics.items():
        parts.append(_message("F", f"{name.split('[')[0]}:{_fields(topic)}".encode()))
    for key, value in (parameters or {}).items():
        kind, code = ("int32_t", "<i") if isinstance(value, int) else ("float", "<f")
        parts.append(_message("P", _keyed(f"{kind} {key}", struct.pack(code, value))))
    rows: list[tuple[int, bytes]] = []
    for number, (name, topic) in enumerate(topics.items()):
        plain, instance = name.rstrip("]").split("[")
        parts.append(_message("A", struct.pack("<BH", int(instance), number) + plain.encode()))
        rows += _rows(number, topic)
    rows.sort(key=lambda row: row[0])
    return b"".join(parts) + b"".join(row for _, row in rows)


def _rows(number: int, topic: Topic) -> list[tuple[int, bytes]]:
    packed = np.zeros(
        len(topic["timestamp"]), dtype=[(k, v.dtype, v.shape[1:]) for k, v in topic.items()]
    )
    for name, values in topic.items():
        packed[name] = values
    times = topic["timestamp"].tolist()
    head = struct.pack("<H", number)
    return [(t, _message("D", head + row.tobytes())) for t, row in zip(times, packed, strict=True)]


def _fields(topic: Topic) -> str:
    return "".join(
        f"{TYPES[v.dtype.str[1:]]}{list(v.shape[1:]) if v.ndim > 1 else ''} {name};"
        for name, v in topic.items()
    )


def _keyed(key: str, value: bytes) -> bytes:
    return bytes([len(key)]) + key.encode() + value


def _message(kind: str, data: bytes) -> bytes:
    return struct.pack("<HB", len(data), ord(kind)) + data
