"""What magnetic observatories exchange: IAGA-2002, and INTERMAGNET's IMFV1 and IAF.

X, Y, Z and H, D, Z (or D, H, Z) are components along north, east, down; H, E, Z and U, V, W are
those of the variometer, in its own axes; F is an absolute scalar instrument and G what F lacks to
the vector; D is in minutes, from DECBAS on. A value from 88880 on is missing or not observed.

IAGA-2002 has seventy characters a row: date, time, day of the year, four values of ten characters
(IAGA V-DAT, IAGA-2002 data exchange format). IMFV1 has a line for each two minutes below one for
each hour, IAF 5888 words of 32 bits for each day, both in tenths, D of IMFV1 in hundredths
(INTERMAGNET Technical Reference Manual, IMFV1.23 and IAFV2.11).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.contents import to_number
from agonic.logs.groups import Found
from agonic.logs.log import About, Stream
from agonic.logs.space.variables import compare_scalar

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
_HOUR = re.compile(
    r"(?P<station>\w{3}) \w{5}(?P<year>\d\d) (?P<day>\d{3}) (?P<hour>\d\d) (?P<elements>[A-Z]{4}) "
    r"(?P<kind>[A-Z]) \w{3} (?P<colatitude>\d{4})(?P<longitude>\d{4}) (?P<base>\d{6}) "
)
"""What stands above the values of an hour in IMFV1."""


def read_tables(path: Path) -> Found:
    """The columns of an observatory, its sensor called by its code; the format fixes nT."""
    data = path.read_bytes()
    if b"\0" in data[:64]:
        return _read_iaf(data)
    text = data.decode("latin-1").replace("\r\n", "\n")
    return _read_hours(text) if _HOUR.match(text) else _read_iaga(text)


def _read_iaf(data: bytes) -> Found:
    """The days of a file of IAF; one that ends in the middle of one has the days before."""
    day = np.dtype([("head", "<i4", 16), ("values", "<i4", (4, 24 * 60)), ("rest", "<i4", 112)])
    words = np.frombuffer(data[: len(data) // day.itemsize * day.itemsize], day)
    if not len(words):
        raise LogError("there is no whole day in it; fetch the file again")
    values = np.moveaxis(words["values"], 1, 2).reshape(-1, 4) / 10.0
    years, days = np.divmod(words["head"][:, 1].astype(np.int64), 1000)
    years += np.where(years < 100, 1900, 0)  # of two digits until 1999
    starts = (years - 1970).astype("datetime64[Y]").astype("datetime64[D]") + (days - 1)
    minutes = np.arange(24 * 60).astype("timedelta64[m]")
    code, letters = (data[at : at + 4].decode("latin-1").strip() for at in (0, 20))
    colatitude, longitude, height = words["head"][0, 2:5].astype(float)
    return _find(
        format="INTERMAGNET IAF",
        station=code or "mag",
        elements=dict(zip([*letters, "F"], values.T, strict=False)),
        time=(starts[:, None] + minutes).ravel().astype("datetime64[ms]"),
        place={
            "latitude_deg": 90.0 - colatitude / 1e3,
            "longitude_deg": longitude / 1e3,
            "altitude_m": height,
        },
    )


def _read_hours(text: str) -> Found:
    """The hours of a file of IMFV1."""
    rows: list[list[float]] = []
    minutes: list[int] = []
    first = _HOUR.match(text)
    assert first is not None
    minute = 0
    for line in text.split("\n"):
        if head := _HOUR.match(line):
            year, day, hour = (int(head[part]) for part in ("year", "day", "hour"))
            begun = np.datetime64(f"{year + (1900 if year > 68 else 2000)}-01-01", "m")
            minute = int(begun.astype(np.int64)) + 60 * (24 * (day - 1) + hour)
        elif line.strip():
            for at in (0, 32):
                rows.append(_read_minute(line[at:]))
                minutes.append(minute)
                minute += 1
    if not rows:
        raise LogError("there is a header and no row of data; fetch the file again")
    values = np.array(rows)
    values[values == 999_999] = np.nan
    units = np.array([100.0 if letter == "D" else 10.0 for letter in first["elements"]])
    return _find(
        format="INTERMAGNET IMFV1",
        station=first["station"].strip(),
        elements=dict(zip(first["elements"], (values / units).T, strict=True)),
        time=np.array(minutes).astype("datetime64[m]").astype("datetime64[ms]"),
        place={
            "latitude_deg": 90.0 - int(first["colatitude"]) / 10.0,
            "longitude_deg": int(first["longitude"]) / 10.0,
        },
        base=int(first["base"]) / 10.0 or np.nan,
    )


def _read_minute(line: str) -> list[float]:
    """The four values of a minute of IMFV1; NaN for one that is cut."""
    widths = (7, 7, 7, 6)  # of F, which has no sign
    cells = [line[8 * k :][:width] for k, width in enumerate(widths)]
    pairs = zip(cells, widths, strict=True)
    return [to_number(cell) if len(cell) == width else np.nan for cell, width in pairs]


def _read_iaga(text: str) -> Found:
    """The rows of a file of IAGA-2002 that are whole."""
    header, rows = _parts(text)
    if not rows:
        raise LogError("there is a header but no row of data; fetch the file again")
    code = header.get("IAGA CODE", "")
    names = [name.upper().removeprefix(code.upper()) for name in header["DATE"].split()[3:]]
    if len(names) < 4:
        names = list(header.get("REPORTED", "").upper())
    if len(names) < 4:
        raise LogError("the header names no four elements such as X, Y, Z and F; fetch it again")
    values = _numbers([row[_VALUES] for row in rows])
    told = {label: _number(header.get(label, "")) for label in (*_PLACES, "DECBAS")}
    base = told["DECBAS"] / 10.0
    if "definitive" in header.get("DATA TYPE", "").lower():
        base = np.nan  # D counts from north
    return _find(
        format="IAGA-2002",
        station=code.strip() or "mag",
        elements=dict(zip(names, values.T, strict=False)),
        time=_moments(rows),
        place={column: told[label] for label, column in _PLACES.items()},
        base=base,
    )


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


def _number(text: str) -> float:
    return to_number(text.encode("latin-1", "replace"))


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


def _find(
    *,
    format: str,
    station: str,
    elements: Mapping[str, Array],
    time: NDArray[np.datetime64],
    place: Mapping[str, float],
    base: float = np.nan,
) -> Found:
    """The table of an observatory: `elements` (n,) by their letters, nT and minutes of arc, and the
    degrees and m of its `place` by their columns; `base` is what D counts from, minutes."""
    known = {name: np.where(np.abs(v) < MISSING, v, np.nan) for name, v in elements.items()}
    seen = {name: v for name, v in known.items() if np.isfinite(v).any() and name != "NUL"}
    field, frame, notes = _find_field(seen, base)
    reading = seen.get("F", seen.get("S"))
    if reading is None and "G" in seen:
        reading = np.linalg.norm(field, axis=1) - seen["G"]
        notes.append("F was restored from G, the magnitude of the vector less F")
    table: dict[str, NDArray[Any]] = {"frame": np.full(len(field), frame, dtype=object)}
    if reading is not None:
        field, beside, said = compare_scalar(field, reading)
        table |= {} if beside is None else {"scalar_nT": beside}
        notes += said
    table |= {f"mag_{axis}_nT": field[:, k] for k, axis in enumerate("xyz")}
    there = {column: value for column, value in place.items() if abs(value) < MISSING}
    table |= {column: np.full(len(field), value) for column, value in there.items()}
    about: About = {"format": format, "remarks": tuple(notes)}
    streams = tuple(Stream(name=name, rows=len(time)) for name in elements if name not in seen)
    return Found({station: {**table, "time": time}}, about, streams=streams)


def _find_field(elements: Mapping[str, Array], base: float) -> tuple[Array, str, list[str]]:
    """The three components (n, 3), the letter of their axes, and notes."""
    kind = next((k for k in (*_NORTH, *_OWN) if set(k) <= set(elements)), None)
    if kind is None:
        raise LogError(
            f"the elements are {', '.join(elements) or 'none'}; a field needs X Y Z, H D Z, H E Z "
            "or U V W"
        )
    if kind in _OWN:
        names = "HEZ" if "H" in kind else "UVW"
        notes = [f"{', '.join(names)} are components in the variometer's own axes"]
        if np.isfinite(base):
            notes.append(f"its first axis is {base / 60:.3f}° east of north (DECBAS)")
        return np.stack([elements[name] for name in names], axis=1), "m", notes
    if kind == "XYZ":
        return np.stack([elements[name] for name in "XYZ"], axis=1), "n", []
    minutes, notes = elements["D"], ["H and D were made north and east"]
    if np.isfinite(base):
        minutes = minutes + base
        notes.append(f"D counts from DECBAS, {base / 60:.3f}°")
    angle = 2 * np.pi * minutes / 21_600.0
    north, east = elements["H"] * np.cos(angle), elements["H"] * np.sin(angle)
    return np.stack([north, east, elements["Z"]], axis=1), "n", notes
