"""NMEA-like sentences: `$NAME,x,y,z,…*HH`, with the time of the computer before them or without.

VectorNav sends its uncorrected readings as `$VNIMU`; what its other sentences hold is corrected.
A sentence of another maker whose name ends in MAG holds x, y, z in raw units first. Source:
VectorNav, VN-100 Interface Control Document, ASCII messages.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.logs.contents import to_number
from agonic.logs.log import Log
from agonic.logs.table import build_log
from agonic.provenance import Input


def _vectors(*units: tuple[str, str]) -> tuple[str, ...]:
    return tuple(f"{name}_{axis}_{unit}" for name, unit in units for axis in "xyz")


_IMU = _vectors(("mag", "G"), ("acc", "m_s2"), ("gyro", "rad_s"))
_EULER = ("yaw_deg", "pitch_deg", "roll_deg")
RAW = {"VNIMU": (*_IMU, "temperature_C")}
"""Sentences with an uncorrected field: the columns they begin with."""
CORRECTED = {
    "VNMAG": _vectors(("mag", "G")),
    "VNMAR": _IMU,
    "VNYMR": (*_EULER, *_IMU),
    "VNYIA": (),
    "VNYBA": (),
    "VNQMR": ("qx", "qy", "qz", "qw", *_IMU),
}
"""Sentences whose field the device has already corrected."""

_SENTENCE = re.compile(r"(?P<before>[^$]*)[$!](?P<body>[A-Z]{3,},[^*]*)(?:\*(?P<sum>\S{2}))?")


def compute_checksum(body: str) -> int:
    """The exclusive or of what lies between $ and *.

    >>> f"{compute_checksum('GPGLL,5300.97914,N,00259.98174,E,125926,A'):02X}"
    '28'
    """
    total = 0
    for byte in body.encode("latin-1", "replace"):
        total ^= byte
    return total


def read_sentences(data: bytes, path: Path, source: Input, notes: tuple[str, ...]) -> Log:
    """The log that sentences are.

    Raises `LogError` where none of them holds a field.
    """
    rows: dict[str, list[list[float]]] = {}
    stamps: dict[str, list[str]] = {}
    wrong = 0
    seen: Counter[str] = Counter()
    for line in data.decode("utf-8", "replace").split("\n"):
        match = _SENTENCE.match(line)
        if match is None:
            continue
        name, *cells = match["body"].split(",")
        seen[name] += 1
        stated = match["sum"]
        if stated and stated.upper() not in (f"{compute_checksum(match['body']):02X}", "XX"):
            wrong += 1
            continue
        before = match["before"].strip(" ,;:\t->[]")
        rows.setdefault(name, []).append([to_number(before), *map(to_number, cells)])
        stamps.setdefault(name, []).append(before)
    name = _choose(rows, seen, wrong)
    columns = ("t", *_columns(name))
    table: dict[str, NDArray[Any]] = {
        column: np.array([row[k] if k < len(row) else np.nan for row in rows[name]])
        for k, column in enumerate(columns)
    }
    if not np.isfinite(table["t"]).any():
        del table["t"]
        if 2 * sum(map(bool, stamps[name])) > len(stamps[name]):
            table["time"] = np.array(stamps[name], dtype=object)
    damaged = (f"{wrong} sentences with a wrong checksum were left out",) * (wrong > 0)
    log = build_log(
        table,
        path=path,
        source=source,
        format="NMEA-like sentences",
        others=[f"${other}" for other in seen if other != name],
        notes=(*notes, *damaged),
    )
    if name not in CORRECTED:
        return log
    remark = f"${name} holds readings that the device has corrected; have it send $VNIMU"
    sensors = (replace(s, corrected=True, notes=(*s.notes, remark)) for s in log.sensors)
    return replace(log, sensors=tuple(sensors))


def _columns(name: str) -> tuple[str, ...]:
    return RAW.get(name) or CORRECTED.get(name) or ("mag_x", "mag_y", "mag_z")


def _choose(rows: dict[str, list[list[float]]], seen: Counter[str], wrong: int) -> str:
    """The sentence with a field, one that is not corrected if there is."""
    others = [name for name in rows if name.endswith("MAG") and name not in CORRECTED]
    for name in (*RAW, *others, *(n for n, columns in CORRECTED.items() if columns)):
        if name in rows:
            return name
    there = ", ".join(f"${name} ({count})" for name, count in seen.most_common(6))
    if wrong == sum(seen.values()):
        raise LogError(f"sentences {there}, all with a wrong checksum: damaged; record again")
    raise LogError(
        f"sentences {there} hold no magnetometer; have the device send its raw field "
        "(VectorNav: $VNIMU), or $MAG,x,y,z"
    )
