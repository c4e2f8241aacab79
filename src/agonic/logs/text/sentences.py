"""NMEA-like sentences: `$NAME,x,y,z,…*HH`, with the time of the computer before them or without.

VectorNav sends its uncorrected readings as `$VNIMU`; what its other sentences hold is corrected.
A sentence of another maker whose name ends in MAG holds x, y, z in raw units first; transducers
(XDR) are taken by the names in them. Of what others tell stand beside: GGA, RMC and ZDA (moments,
places), HDT and THS (true heading, but those of a magnetic compass, talker HC), PASHR (heading,
roll, pitch). Headings of HDG, HDM and VHW follow a compass and are left. Source: VectorNav, VN-100
Interface Control Document, ASCII messages; NMEA 0183, version 4.11; NovAtel, OEM7 manual (PASHR).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from math import nan
from pathlib import Path

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.contents import to_number
from agonic.logs.headers.header import identify_column
from agonic.logs.log import Log
from agonic.logs.rows.auxiliary import PERIODS_DEG
from agonic.logs.rows.resample import resample
from agonic.logs.table import build_log
from agonic.logs.text.dialects import find_group, mark_corrected
from agonic.logs.text.layout import Table
from agonic.provenance import Input
from agonic.units import DAY_S

_TAKEN = ("roll_deg", "pitch_deg", "temperature")
"""What transducers tell beside a field."""
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
    arrays = {header: np.array(pairs, dtype=np.float64).T for header, pairs in found.items()}
    columns: dict[str, Series] = {header: (lines, v) for header, (lines, v) in arrays.items()}
    for header, series in read_transducers(sentences).items():
        column = identify_column(header)
        if column is not None and column.quantity.column in _TAKEN:
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


ALONE = "MAG"
"""What a sentence of three numbers without a name is taken for."""
_CH_ROBOTICS = {"0": "PCHRSGYR", "1": "PCHRSACC", "2": "PCHRSMAG"}
"""The sensors of $PCHRS,sensor,time,x,y,z, whose time comes behind the axes then."""
_SENTENCE = re.compile(
    r"(?P<before>[^$]*)[$!](?P<body>(?:[A-Z]{3,},|(?=-?[\d.]+,))[^*]*)(?:\*(?P<sum>\S{2}))?"
)


def compute_checksum(body: str) -> int:
    """The exclusive or of what lies between $ and *.

    >>> f"{compute_checksum('GPGLL,5300.97914,N,00259.98174,E,125926,A'):02X}"
    '28'
    """
    total = 0
    for byte in body.encode("latin-1", "replace"):
        total ^= byte
    return total


def read_sentences(
    data: bytes, path: Path, source: Input, notes: tuple[str, ...], unit: str | None = None
) -> Log:
    """The log that sentences are; `unit` is that of a field whose sentence does not fix it.

    Raises `LogError` where none of them holds a field.
    """
    found, stamps, seen, wrong, first = _scan(data.decode("utf-8", "replace").split("\n"))
    try:
        name, lines, table = _read_field(found, seen, wrong)
    except LogError as error:
        raise LogError(f"{error}{first}") from None
    when = dict(zip((number for number, _, _ in found), stamps, strict=True))
    said = _add_beside(table, lines, [when[line] for line in lines.tolist()], found)
    damaged = (f"{wrong} sentences with a wrong checksum were left out{first}",) * (wrong > 0)
    log = build_log(
        table,
        path=path,
        source=source,
        format="NMEA-like sentences",
        unit=unit,
        others=[f"${other}" for other in seen if other != name],
        notes=(*notes, *damaged),
        remarks=said,
    )
    kind = find_group("sentences").get(name)
    how = kind.corrected.format(f"${name}") if kind else ""
    return replace(log, sensors=tuple(mark_corrected(one, how) for one in log.sensors))


def _scan(
    rows: Sequence[str],
) -> tuple[list[Sentence], list[str], Counter[str], int, str]:
    """The sentences with a right checksum, or none, what stands before each, how many there are
    of each name, how many have a wrong one, and where the first of those is.
    """
    found: list[Sentence] = []
    stamps: list[str] = []
    wrong, first = 0, ""
    seen: Counter[str] = Counter()
    for number, line in enumerate(rows):
        match = _SENTENCE.match(line)
        if match is None:
            continue
        name, *cells = match["body"].split(",") if match["body"][0].isalpha() else _name(match)
        seen[name] += 1
        stated = match["sum"]
        if stated and stated.upper() not in (f"{compute_checksum(match['body']):02X}", "XX"):
            first = first or (
                f", the first in line {number + 1}: *{stated} is not "
                f"*{compute_checksum(match['body']):02X}"
            )
            wrong += 1
            continue
        if name == "PCHRS" and len(cells) > 4:  # of UM6 and UM7
            name, cells = _CH_ROBOTICS.get(cells[0], name), [*cells[2:5], cells[1]]
        found.append((number, name, cells))
        stamps.append(match["before"].strip(" ,;:\t->[]"))
    return found, stamps, seen, wrong, first


def _name(match: re.Match[str]) -> list[str]:
    """The cells of a sentence without a name, which three numbers alone take for MAG."""
    cells = match["body"].split(",")
    return [ALONE if len(cells) == 3 else "", *cells]


def _read_field(
    found: Sequence[Sentence], seen: Counter[str], wrong: int
) -> tuple[str, Array, Table]:
    """The sentence that holds the field, the lines of its readings, and their columns."""
    names = {name for _, name, _ in found}
    known = find_group("sentences")
    corrected = [name for name, kind in known.items() if kind.corrected]
    raw = [name for name in known if name not in corrected]
    others = [name for name in names if name.endswith("MAG") and name not in corrected]
    for name in (*raw, *others, *corrected):
        if name in names:
            return name, *_read_sentence(found, name)
    told = read_transducers(found)
    axes = {axis: h for h in told if (axis := _find_axis(h))}
    if len(axes) == 3:
        lines = told[axes["x"]][0]
        return "XDR", lines, {header: told[header][1] for header in axes.values()}
    raise _explain(seen, wrong)


def _find_axis(header: str) -> str:
    column = identify_column(header)
    return column.axis if column is not None and column.quantity.column == "field" else ""


def _read_sentence(found: Sequence[Sentence], name: str) -> tuple[Array, Table]:
    """The lines of a sentence, and its columns."""
    rows = [(line, cells) for line, other, cells in found if other == name]
    kind = find_group("sentences").get(name)
    columns = [cell.header for cell in kind.cells] if kind else [f"mag_{axis}" for axis in "xyz"]
    table: Table = {
        column: np.array([to_number(cells[k]) if k < len(cells) else np.nan for _, cells in rows])
        for k, column in enumerate(columns)
    }
    return np.array([line for line, _ in rows], dtype=np.float64), table


def _add_beside(
    table: Table, lines: Array, stamps: Sequence[str], found: Sequence[Sentence]
) -> tuple[str, ...]:
    """Add to the columns of the field what the other sentences tell, and the times; notes."""
    beside = {h: series for h, series in read_beside(found).items() if h not in table}
    table |= carry(beside, lines)
    seconds = np.array([to_number(stamp) for stamp in stamps])
    if "t" in table:
        return ()
    if np.isfinite(seconds).any():
        table["t"] = seconds
    elif 2 * sum(map(bool, stamps)) > len(stamps):
        table["time"] = np.array(stamps, dtype=object)
    elif clock := read_clock(found):
        table["timestamp_s"] = np.interp(lines, *clock, left=np.nan, right=np.nan)
        return ("times by the GPS sentences between the readings",)
    return ()


def _explain(seen: Counter[str], wrong: int) -> LogError:
    """What the sentences are, and what is needed."""
    there = ", ".join(f"${name} ({count})" for name, count in seen.most_common(6))
    if wrong == sum(seen.values()):
        return LogError(f"sentences {there}, all with a wrong checksum: damaged; record again")
    headings = [name for name in seen if name[-3:] in ("HDG", "HDM", "HDT", "THS", "VHW")]
    compass = (
        "; headings of a compass alone are corrected by a swing: agonic plan swing"
        if headings
        else ""
    )
    return LogError(
        f"sentences {there} hold no magnetometer; have the device send its raw field "
        f"(VectorNav: $VNIMU), $MAG,x,y,z, or $…XDR with MAGX, MAGY and MAGZ{compass}"
    )
