"""NMEA-like sentences: `$NAME,x,y,z,…*HH`, with the time of the computer before them or without.

VectorNav sends its uncorrected readings as `$VNIMU`; what its other sentences hold is corrected.
A sentence of another maker whose name ends in MAG holds x, y, z in raw units first; transducers
(XDR) are taken by the names in them. What other sentences tell stands beside, see `nmea`. Source:
VectorNav, VN-100 Interface Control Document, ASCII messages.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.contents import to_number
from agonic.logs.headers.header import identify_column
from agonic.logs.log import Log
from agonic.logs.table import build_log
from agonic.logs.text.dialects import SENTENCES
from agonic.logs.text.kinds import mark_corrected
from agonic.logs.text.layout import Table
from agonic.logs.text.nmea import Sentence, carry, read_beside, read_clock, read_transducers
from agonic.provenance import Input

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
    how = SENTENCES[name].corrected.format(f"${name}") if name in SENTENCES else ""
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
    corrected = [name for name, kind in SENTENCES.items() if kind.corrected]
    raw = [name for name in SENTENCES if name not in corrected]
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
    known = SENTENCES[name].cells if name in SENTENCES else ()
    columns = [cell.header for cell in known] or [f"mag_{axis}" for axis in "xyz"]
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
