"""NMEA-like sentences: `$NAME,x,y,z,…*HH`, with the time of the computer before them or without.

VectorNav sends its uncorrected readings as `$VNIMU`; what its other sentences hold is corrected.
A sentence of another maker whose name ends in MAG holds x, y, z in raw units first; transducers
(XDR) are taken by the names in them. What others tell beside is in the table of dialects. Headings
of HDG, HDM and VHW follow a compass and are left.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from functools import reduce
from math import nan
from operator import xor
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.contents import to_number
from agonic.logs.groups import Found
from agonic.logs.headers.columns import read_dialects
from agonic.logs.headers.header import identify_column, name_quantity
from agonic.logs.log import About
from agonic.logs.rows.auxiliary import PERIODS_DEG, resample
from agonic.logs.text.dialects import find_group
from agonic.logs.text.layout import Table
from agonic.units import DAY_S

_KNOWN = read_dialects()["groups"]["sentences"]
_TAKEN = ("roll_deg", "pitch_deg", "temperature")
"""What transducers tell beside a field."""
ALONE = "MAG"
"""What a sentence of three numbers without a name is taken for."""
_SENTENCE = re.compile(
    r"(?P<before>[^$]*)[$!](?P<body>(?:[A-Z]{3,},|(?=-?[\d.]+,))[^*]*)(?:\*(?P<sum>\S{2}))?"
)


class Sentence(NamedTuple):
    """The number of its line, its name, its cells, and what stands before it."""

    line: int
    name: str
    cells: Sequence[str]
    stamp: str = ""


Series = tuple[Array, Array]
"""Numbers of lines, and the values that they hold."""


def read_transducers(sentences: Sequence[Sentence]) -> dict[str, Series]:
    """The values of XDR sentences by the names in them, those of one round at one line."""
    rounds: list[tuple[int, dict[str, float]]] = []
    for line, name, cells, _ in sentences:
        if not name.endswith("XDR"):
            continue
        for kind, value, unit, named in zip(*(cells[k::4] for k in range(4)), strict=False):
            known = _KNOWN["transducers"].get(f"{kind} {unit}")
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
    """Columns of canonical names that the sentences tell, at the lines where they do."""
    found: dict[str, list[tuple[float, float]]] = {}
    for sentence in sentences:
        for header, written in _match("beside", sentence).items():
            number, comma, side = written.partition(",")
            value = to_number(number)
            if comma:  # ddmm.mmm, and the hemisphere
                value = np.floor(value / 100) + value % 100 / 60
            if np.isfinite(value):
                value = -value if side in ("S", "W") else value
                found.setdefault(header, []).append((sentence.line, value))
    arrays = {header: np.array(pairs, dtype=np.float64).T for header, pairs in found.items()}
    columns: dict[str, Series] = {header: (lines, v) for header, (lines, v) in arrays.items()}
    for header, series in read_transducers(sentences).items():
        if name_quantity(header) in _TAKEN:
            columns.setdefault(header, series)
    return columns


def _match(rows: str, sentence: Sentence) -> dict[str, str]:
    """What a sentence tells by the rows of the table of dialects; a compass is not asked."""
    kind = sentence.name if sentence.name in _KNOWN[rows] else sentence.name[-3:]
    known = kind in _KNOWN[rows] and not sentence.name.startswith("HC")
    match = re.match(_KNOWN[rows][kind], ",".join(sentence.cells)) if known else None
    return match.groupdict("") if match else {}


def read_clock(sentences: Sequence[Sentence]) -> Series | None:
    """Lines, and the Unix seconds at them, or without a date those of the day. `None` where nothing
    tells them."""
    told = [(one.line, parts) for one in sentences if (parts := _match("clock", one))]
    if len(told) < 2:
        return None
    hour, minute, second = (
        np.array([float(parts[name]) for _, parts in told]) for name in ("hour", "minute", "second")
    )
    seconds = np.unwrap(3600.0 * hour + 60.0 * minute + second, period=DAY_S)
    starts = []
    for of_day, (_, parts) in zip(seconds, told, strict=True):
        if parts.get("day"):
            day, month, year = (int(parts[name]) for name in ("day", "month", "year"))
            year += 0 if year > 99 else 2000 if year < 69 else 1900
            with suppress(ValueError):
                date = datetime(year, month, day, tzinfo=UTC)
                starts.append(date.timestamp() - np.floor(of_day / DAY_S) * DAY_S)
    first = np.append(True, np.diff(seconds) > 0)
    lines = np.array([line for line, _ in told], dtype=np.float64)
    return lines[first], seconds[first] + (np.median(starts) if starts else 0.0)


def carry(series: Mapping[str, Series], lines: Array) -> dict[str, Array]:
    """The columns at other lines, interpolated between those where they were told; NaN farther from
    one than twice their usual distance."""
    carried = {}
    for header, (at, values) in series.items():
        period = PERIODS_DEG.get(header)
        found = resample(at, values, lines, period=period) if len(at) > 1 else None
        if found is None:
            continue
        after = np.searchsorted(at, lines).clip(1, len(at) - 1)
        apart = np.minimum(np.abs(lines - at[after - 1]), np.abs(at[after] - lines))
        found[apart > 2 * np.median(np.diff(at))] = np.nan
        carried[header] = found
    return carried


def compute_checksum(body: str) -> int:
    """The exclusive or of what lies between $ and *."""
    return reduce(xor, body.encode("latin-1", "replace"), 0)


def read_sentences(text: str) -> Found:
    """The columns of a field that sentences tell, with what others do beside it."""
    found, seen, wrong, first = _scan(text.split("\n"))
    try:
        name, lines, table = _read_field(found, seen, wrong)
    except LogError as error:
        raise LogError(f"{error}{first}") from None
    when = {one.line: one.stamp for one in found}
    remarks = _add_beside(table, lines, [when[line] for line in lines.tolist()], found)
    about: About = {
        "format": "NMEA-like sentences",
        "others": [f"${other}" for other in seen if other != name],
        "notes": (f"{wrong} sentences with a wrong checksum were left out{first}",) * (wrong > 0),
        "remarks": remarks,
    }
    kind = find_group("sentences").get(name)
    return Found({"": table}, about, {"": kind.corrected.format(f"${name}")} if kind else {})


def _scan(rows: Sequence[str]) -> tuple[list[Sentence], Counter[str], int, str]:
    """The sentences with a right checksum, or none, how many there are of each name, how many have
    a wrong one, and where the first of those is."""
    found: list[Sentence] = []
    wrong, first = 0, ""
    seen: Counter[str] = Counter()
    for number, line in enumerate(rows):
        match = _SENTENCE.match(line)
        if match is None:
            continue
        body, stated = match["body"], match["sum"]
        name, *cells = body.split(",")
        if not body[0].isalpha():  # three numbers alone are of a magnetometer
            name, cells = ALONE if len(cells) == 2 else "", [name, *cells]
        seen[name] += 1
        right = f"{compute_checksum(body):02X}" if stated else ""
        if stated and stated.upper() not in (right, "XX"):
            first = first or f", the first in line {number + 1}: *{stated} is not *{right}"
            wrong += 1
            continue
        if name == "PCHRS" and len(cells) > 4:  # of UM6 and UM7
            name, cells = _KNOWN["sensors"].get(cells[0], name), [*cells[2:5], cells[1]]
        found.append(Sentence(number, name, cells, match["before"].strip(" ,;:\t->[]")))
    return found, seen, wrong, first


def _read_field(
    found: Sequence[Sentence], seen: Counter[str], wrong: int
) -> tuple[str, Array, Table]:
    """The sentence that holds the field, the lines of its readings, and their columns."""
    names = {one.name for one in found}
    known = find_group("sentences")
    corrected = [name for name, kind in known.items() if kind.corrected]
    raw = [name for name in known if name not in corrected]
    others = [name for name in names if name.endswith("MAG") and name not in corrected]
    name = next((name for name in (*raw, *others, *corrected) if name in names), None)
    if name is not None:
        rows = [one for one in found if one.name == name]
        headers = [f"mag_{axis}" for axis in "xyz"]
        if name in known:
            headers = [cell.header for cell in known[name].cells]
        table: Table = {
            header: np.array(
                [to_number(c[k]) if k < len(c) else nan for c in (r.cells for r in rows)]
            )
            for k, header in enumerate(headers)
        }
        return name, np.array([one.line for one in rows], dtype=np.float64), table
    transducers = read_transducers(found)
    axes = {}
    for header in transducers:
        column = identify_column(header)
        if column is not None and column.quantity.column == "field" and column.axis:
            axes[column.axis] = header
    if len(axes) == 3:
        lines = transducers[axes["x"]][0]
        return "XDR", lines, {header: transducers[header][1] for header in axes.values()}
    raise _explain(seen, wrong)


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
    heads = any(name[-3:] in ("HDG", "HDM", "HDT", "THS", "VHW") for name in seen)
    swing = "; headings of a compass alone are corrected by a swing: agonic plan swing"
    compass = swing if heads else ""
    return LogError(
        f"sentences {there} hold no magnetometer; have the device send its raw field "
        f"(VectorNav: $VNIMU), $MAG,x,y,z, or $…XDR with MAGX, MAGY and MAGZ{compass}"
    )
