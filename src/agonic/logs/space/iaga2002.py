"""IAGA-2002, the exchange format of magnetic observatories.

Seventy characters a row: date, time, day of the year, four values of ten characters. X, Y, Z and
H, D, Z (or D, H, Z) are components along north, east, down; H, E, Z and U, V, W are those of the
variometer, in its own axes; F is an absolute scalar instrument and G what F lacks to the vector.
99999 is missing, 88888 not observed (IAGA V-DAT, IAGA-2002 data exchange format).
"""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.contents import to_number
from agonic.logs.log import Log
from agonic.logs.space.products import compare_scalar
from agonic.logs.table import build_log
from agonic.provenance import Input

MISSING = 88_880.0
"""Values from here on are codes: 88888 not observed, 99999 missing."""

_TIME, _VALUES, _WIDTH = slice(0, 23), slice(30, 70), 10
_NORTH = ("XYZ", "HDZ", "DHZ")
_OWN = ("HEZ", "UVW", "EHZ")
_PLACES = {
    "GEODETIC LATITUDE": "latitude_deg",
    "GEODETIC LONGITUDE": "longitude_deg",
    "ELEVATION": "altitude_m",
}


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log of an observatory: one sensor, with its station's place; the format fixes nT."""
    text = path.read_bytes().decode("latin-1").replace("\r\n", "\n")
    header, rows = _parts(text)
    if not rows:
        raise LogError("there is a header but no row of data; fetch the file again")
    station = header.get("IAGA CODE", "").strip() or "mag"
    elements, others = _elements(header, rows)
    table, notes = _table(header, elements, len(rows))
    table["time"] = _moments(rows)
    log = build_log(
        table, path=path, source=source, format="IAGA-2002", others=others, remarks=tuple(notes)
    )
    return replace(log, sensors=(log.sensors[0].with_columns(name=station),))


def _parts(text: str) -> tuple[dict[str, str], list[str]]:
    """The labelled lines of the header, and the rows of data that are whole."""
    lines = text.split("\n")
    header: dict[str, str] = {}
    start = next((k for k, line in enumerate(lines) if line.startswith("DATE")), len(lines))
    header["DATE"] = lines[start].rstrip(" |") if start < len(lines) else ""
    for line in lines[:start]:
        comment = re.match(r" # (DECBAS)\s+(\S+)", line)
        label, value = comment.groups() if comment else (line[1:24].strip(), line[24:69].strip())
        header.setdefault(label.upper(), value)
    rows = [line for line in lines[start + 1 :] if len(line) >= _VALUES.stop and line[4] == "-"]
    return header, rows


def _elements(header: dict[str, str], rows: list[str]) -> tuple[dict[str, Array], list[str]]:
    """The values of each element, and the names of those that were never observed."""
    code = header.get("IAGA CODE", "").upper()
    names = [name.upper().removeprefix(code) for name in header.get("DATE", "").split()[3:]]
    if len(names) < 4:
        names = list(header.get("REPORTED", "").upper())
    if len(names) < 4:
        raise LogError("the header names no four elements such as X, Y, Z and F; fetch it again")
    values = _numbers([row[_VALUES] for row in rows])
    values[np.abs(values) >= MISSING] = np.nan
    found = dict(zip(names, values.T, strict=False))
    seen = {name: v for name, v in found.items() if np.isfinite(v).any() and name != "NUL"}
    return seen, [name for name in found if name not in seen]


def _numbers(texts: list[str]) -> Array:
    """The four values of each row; NaN where there is no number."""
    cells = np.array([text.encode("latin-1", "replace") for text in texts], dtype="S40")
    split = cells.view(f"S{_WIDTH}").reshape(len(texts), -1)
    try:
        return split.astype(np.float64)
    except ValueError:
        return np.array([[to_number(cell) for cell in row] for row in split])


def _moments(rows: list[str]) -> NDArray[Any]:
    """The times of the rows; NaT where there is none."""
    stamps = np.array([row[_TIME].replace(" ", "T") for row in rows])
    try:
        return stamps.astype("datetime64[ms]")
    except ValueError:
        moments = np.full(len(rows), np.datetime64("NaT", "ms"))
        for k, stamp in enumerate(stamps):
            with suppress(ValueError):
                moments[k] = np.datetime64(stamp, "ms")
        return moments


def _table(
    header: dict[str, str], elements: dict[str, Array], n: int
) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """Field, its axes, scalar reading and place, and notes on them."""
    kind = next((k for k in (*_NORTH, *_OWN) if set(k) <= set(elements)), None)
    if kind is None:
        raise LogError(
            f"the elements are {', '.join(elements) or 'none'}; a field needs X Y Z, H D Z, H E Z "
            "or U V W"
        )
    field, frame, notes = _field(kind, elements, header)
    reading = elements.get("F", elements.get("S"))
    if reading is None and "G" in elements:
        reading = np.linalg.norm(field, axis=1) - elements["G"]
        notes.append("F was restored from G, the magnitude of the vector less F")
    table: dict[str, NDArray[Any]] = {"frame": np.full(n, frame, dtype=object)}
    if reading is not None:
        field, beside, said = compare_scalar(field, reading)
        table |= {} if beside is None else {"scalar_nT": beside}
        notes += said
    table |= {f"mag_{axis}_nT": field[:, k] for k, axis in enumerate("xyz")}
    for label, column in _PLACES.items():
        value = to_number(header.get(label, "").encode("latin-1", "replace"))
        if abs(value) < MISSING:
            table[column] = np.full(n, value)
    return table, notes


def _field(
    kind: str, elements: dict[str, Array], header: dict[str, str]
) -> tuple[Array, str, list[str]]:
    """The three components (n, 3), the letter of their axes, and notes."""
    base = to_number(header.get("DECBAS", "").encode("latin-1", "replace")) / 10.0  # minutes
    if kind in _OWN:
        names = "HEZ" if "H" in kind else "UVW"
        notes = [f"{', '.join(names)} are components in the variometer's own axes"]
        if np.isfinite(base):
            notes.append(f"its first axis is {base / 60:.3f}° east of north (DECBAS)")
        return np.stack([elements[name] for name in names], axis=1), "m", notes
    if kind == "XYZ":
        return np.stack([elements[name] for name in "XYZ"], axis=1), "n", []
    minutes, notes = elements["D"], ["H and D were made north and east"]
    if "definitive" not in header.get("DATA TYPE", "").lower() and np.isfinite(base):
        minutes = minutes + base
        notes.append(f"D counts from DECBAS, {base / 60:.3f}°")
    angle = 2 * np.pi * minutes / 21_600.0
    north, east = elements["H"] * np.cos(angle), elements["H"] * np.sin(angle)
    return np.stack([north, east, elements["Z"]], axis=1), "n", notes
