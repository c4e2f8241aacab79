"""Synthetic ArduPilot dataflash logs: formats as the autopilots write them, values as given."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pymavlink.DFReader import FORMAT_TO_STRUCT

FORMATS = {
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "PARM": (32, "QNf", "TimeUS,Name,Value"),
    "MSG": (59, "QZ", "TimeUS,Message"),
    "MAG": (
        103,
        "QBhhhhhhhhhBI",
        "TimeUS,I,MagX,MagY,MagZ,OfsX,OfsY,OfsZ,MOX,MOY,MOZ,Health,S",
    ),
    "ATT": (68, "QccccCCCCB", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw,AEKF"),
    "IMU": (162, "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    "BAT": (115, "QBff", "TimeUS,Instance,Volt,Curr"),
    "CTUN": (4, "Qff", "TimeUS,ThI,ThO"),
    "GPS": (84, "QBBIHBcLLe", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt"),
}
SCALES = {"c": 100, "C": 100, "e": 100, "E": 100, "L": 1e7}

Columns = dict[str, ArrayLike]


def dataflash(
    *tables: tuple[str, Columns], formats: dict[str, tuple[int, str, str]] | None = None
) -> bytes:
    """The bytes of a log with these messages, sorted by `TimeUS` where they have one."""
    known = {**FORMATS, **(formats or {})}
    names = dict.fromkeys(["FMT", *(name for name, _ in tables)])
    rows: list[tuple[float, bytes]] = []
    for name, columns in tables:
        packed = messages(known[name], columns)
        size = packed.dtype.itemsize
        times = np.broadcast_to(np.asarray(columns.get("TimeUS", 0.0), float), len(packed))
        data = packed.tobytes()
        rows += [(t, data[i * size : (i + 1) * size]) for i, t in enumerate(times.tolist())]
    rows.sort(key=lambda row: row[0])
    heads = [format_message(known, name) for name in names]
    return b"".join(heads) + b"".join(data for _, data in rows)


def format_message(known: dict[str, tuple[int, str, str]], name: str) -> bytes:
    """The FMT message that describes `name`."""
    kind, letters, columns = known[name]
    length = message_dtype(letters, columns).itemsize
    description = {
        "Type": kind,
        "Length": length,
        "Name": name,
        "Format": letters,
        "Columns": columns,
    }
    return messages(FORMATS["FMT"], description).tobytes()


def messages(fmt: tuple[int, str, str], columns: Columns) -> np.ndarray:
    """The packed messages of one type, (n,); columns that are not given are zero."""
    kind, letters, names = fmt
    n = max(np.size(values) for values in columns.values())
    packed = np.zeros(n, dtype=message_dtype(letters, names))
    packed["marks"], packed["kind"] = b"\xa3\x95", kind
    for letter, name in zip(letters, names.split(","), strict=True):
        if name in columns:
            values = np.asarray(columns[name])
            whole = packed.dtype[name].kind in "iu"
            packed[name] = np.rint(values * SCALES.get(letter, 1)) if whole else values
    return packed


def message_dtype(letters: str, names: str) -> np.dtype:
    """Header and fields without padding."""
    kinds = [FORMAT_TO_STRUCT[letter][0] for letter in letters]
    fields = [
        (name, f"S{kind[:-1]}" if kind.endswith("s") else f"<{kind}")
        for name, kind in zip(names.split(","), kinds, strict=True)
    ]
    return np.dtype([("marks", "S2"), ("kind", "u1"), *fields])


def parameters(values: dict[str, float], time_us: float = 0.0) -> tuple[str, Columns]:
    """PARM messages."""
    return "PARM", {
        "TimeUS": np.full(len(values), time_us),
        "Name": np.array([name.encode() for name in values]),
        "Value": np.array(list(values.values())),
    }
