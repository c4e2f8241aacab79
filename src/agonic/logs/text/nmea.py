"""What NMEA 0183 sentences tell beside a field: time, place, attitude, transducers.

Read are GGA, RMC and ZDA (moments, places), HDT and THS (true heading, but those of a magnetic
compass, talker HC), PASHR (heading, roll, pitch) and XDR (transducers by name). Headings of HDG,
HDM and VHW follow a compass and are left. Source: NMEA 0183, version 4.11; PASHR as NovAtel's
OEM7 manual documents it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from math import nan

import numpy as np

from agonic.arrays import Array
from agonic.logs.contents import to_number
from agonic.logs.headers.header import identify_column
from agonic.logs.rows.auxiliary import PERIODS_DEG
from agonic.logs.rows.resample import resample
from agonic.units import DAY_S

_XDR_UNITS = {"A": {"D": "deg"}, "C": {"C": "C", "K": "K"}}
"""Units of the transducers, by their type and the letter in the sentence."""
_CLOCK = re.compile(r"(\d\d)(\d\d)(\d\d(?:\.\d*)?)")
_FEWEST = 2
_REACH = 2.0
"""Usual distances between two sentences of a kind that one may be from a field."""

Sentence = tuple[int, str, Sequence[str]]
"""The number of its line, its name and its cells."""
Series = tuple[Array, Array]
"""Numbers of lines, and the values that they hold."""


def read_transducers(sentences: Sequence[Sentence]) -> dict[str, Series]:
    """The values of XDR sentences by the names in them, those of one round at one line.

    >>> cells = "G,12,,MAGX,G,-3,,MAGY,A,2.5,D,PITCH".split(",")
    >>> sorted(read_transducers([(0, "YXXDR", cells)]))
    ['MAGX', 'MAGY', 'PITCH (deg)']
    """
    rounds: list[tuple[int, dict[str, float]]] = []
    for line, name, cells in sentences:
        if not name.endswith("XDR"):
            continue
        for kind, value, unit, named in zip(*(cells[k::4] for k in range(4)), strict=False):
            known = _XDR_UNITS.get(kind, {}).get(unit)
            header = f"{named} ({known})" if known else named
            if not rounds or header in rounds[-1][1]:
                rounds.append((line, {}))
            rounds[-1][1][header] = to_number(value)
    names = list(dict.fromkeys(name for _, values in rounds for name in values))
    lines = np.array([line for line, _ in rounds], dtype=np.float64)
    return {
        name: (lines, np.array([values.get(name, nan) for _, values in rounds])) for name in names
    }


def read_beside(sentences: Sequence[Sentence]) -> dict[str, Series]:
    """Columns of canonical names that the sentences tell, at the lines where they do.

    >>> list(read_beside([(4, "GPHDT", ["74.8", "T"])]))
    ['heading_deg']
    """
    found: dict[str, list[tuple[float, float]]] = {}
    for line, name, cells in sentences:
        for header, value in _read_one(name, cells).items():
            if np.isfinite(value):
                found.setdefault(header, []).append((line, value))
    columns = {header: _as_series(pairs) for header, pairs in found.items()}
    for header, series in read_transducers(sentences).items():
        column = identify_column(header)
        if column is not None and column.quantity.column in (
            "roll_deg",
            "pitch_deg",
            "temperature",
        ):
            columns.setdefault(header, series)
    return columns


def read_clock(sentences: Sequence[Sentence]) -> Series | None:
    """Lines, and the Unix seconds at them, or without a date those of the day.

    `None` where nothing tells them.

    >>> read_clock([(0, "GPGGA", ["235959.5"]), (9, "GPGGA", ["000000.5"])])[1].tolist()
    [86399.5, 86400.5]
    """
    clock: list[tuple[int, float]] = []
    dates: list[float] = []
    for line, name, cells in sentences:
        if name[-3:] not in ("GGA", "RMC", "ZDA") or not cells:
            continue
        match = _CLOCK.fullmatch(cells[0])
        if match is None:
            continue
        second = 3600.0 * int(match[1]) + 60.0 * int(match[2]) + float(match[3])
        clock.append((line, second))
        midnight = _read_midnight(name[-3:], cells)
        if midnight is not None:
            dates.append(midnight + second - _unwrap(clock)[-1])
    if len(clock) < _FEWEST:
        return None
    lines, seconds = np.array([line for line, _ in clock]), _unwrap(clock)
    first = np.append(True, np.diff(seconds) > 0)
    start = float(np.median(dates)) if dates else 0.0
    return lines[first].astype(np.float64), seconds[first] + start


def carry(series: Mapping[str, Series], lines: Array) -> dict[str, Array]:
    """The columns at other lines, interpolated between those where they were told; NaN in holes."""
    carried = {}
    for header, (at, values) in series.items():
        period = PERIODS_DEG.get(header)
        found = resample(at, values, lines, period=period) if len(at) >= _FEWEST else None
        if found is None:
            continue
        after = np.searchsorted(at, lines).clip(1, len(at) - 1)
        apart = np.minimum(np.abs(lines - at[after - 1]), np.abs(at[after] - lines))
        found[apart > _REACH * np.median(np.diff(at))] = np.nan
        carried[header] = found
    return carried


def _unwrap(clock: Sequence[tuple[int, float]]) -> Array:
    return np.unwrap([second for _, second in clock], period=DAY_S)


def _as_series(pairs: Sequence[tuple[float, float]]) -> Series:
    lines, values = np.array(pairs, dtype=np.float64).T
    return lines, values


def _read_midnight(kind: str, cells: Sequence[str]) -> float | None:
    """Unix seconds at the beginning of the day that a sentence names."""
    try:
        if kind == "RMC":
            date = datetime.strptime(cells[8], "%d%m%y")
        elif kind == "ZDA":
            date = datetime(int(cells[3]), int(cells[2]), int(cells[1]))
        else:
            return None
    except (ValueError, IndexError):
        return None
    return date.replace(tzinfo=UTC).timestamp()


def _read_one(name: str, cells: Sequence[str]) -> dict[str, float]:
    """The columns that one sentence tells."""
    kind, padded = name[-3:], [*cells, *[""] * 12]
    if name == "PASHR":
        names = ("heading_deg", "roll_deg", "pitch_deg", "heading_sd_deg")
        values = (padded[1] if padded[2] == "T" else "", padded[3], padded[4], padded[8])
        return dict(zip(names, map(to_number, values), strict=True))
    if kind in ("HDT", "THS") and not name.startswith("HC"):
        usable = padded[1] in (("T", "") if kind == "HDT" else ("A",))
        return {"heading_deg": to_number(padded[0]) if usable else nan}
    if kind == "GGA" and padded[5] not in ("", "0"):
        return {**_read_place(padded[1:5]), "altitude_m": to_number(padded[8])}
    if kind == "RMC" and padded[1] == "A":
        return _read_place(padded[2:6])
    return {}


def _read_place(cells: Sequence[str]) -> dict[str, float]:
    """Degrees of ddmm.mmm, N or S, dddmm.mmm, E or W."""
    found = {}
    for header, value, side in (
        ("latitude_deg", cells[0], cells[1]), ("longitude_deg", cells[2], cells[3]),
    ):  # fmt: skip
        number = to_number(value)
        degrees = np.floor(number / 100) + number % 100 / 60
        found[header] = -degrees if side in ("S", "W") else degrees
    return found
