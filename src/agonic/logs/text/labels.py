"""Lines that name each of their numbers, as sketches print them: `mx: 12.5, my=-3, mz: 44 uT`.

A name may stand before three numbers (`Mag (uT) [1, 2, 3]`), or before axes that are named alone
(`Mag X: 1 Y: 2 Z: 3`). A record may take several lines, until a name comes again. A unit behind a
number is that of the numbers before it in its line, and what a logger writes before a line is its
time. So do messages as `rostopic echo` prints them: YAML, with `---` between them.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.logs.headers.columns import find_quantities
from agonic.logs.headers.header import identify_column, is_unit
from agonic.logs.headers.quantities import FALLBACK
from agonic.logs.text.layout import NUMBER, SAMPLE, STAMP
from agonic.logs.text.records import make_table

_LINE = re.compile(r"(?P<indent> *)(?P<key>[^\W\d]\w*):(?: +(?P<value>.*))?")
_ITEM = re.compile(r" *- ?.*")
_BETWEEN = ("---", "...")


def is_echo(rows: Sequence[str]) -> bool:
    """Whether lines are such messages: names alone, values below them, and a mark between."""
    plain = [row.rstrip() for row in rows]
    opened = any((line := _LINE.fullmatch(row)) and not line["value"] for row in plain)
    known = (row in _BETWEEN or _LINE.fullmatch(row) or _ITEM.fullmatch(row) for row in plain)
    return "---" in plain and opened and all(known)


def read_echo(rows: Iterable[str]) -> Iterator[dict[str, object]]:
    """The values of each message by dotted names."""
    message: dict[str, object] = {}
    within: list[tuple[int, str]] = []
    for row in rows:
        if row.rstrip() in _BETWEEN:
            if message:
                yield message
            message, within = {}, []
            continue
        line = _LINE.fullmatch(row.rstrip())
        if line is None:
            continue
        indent = len(line["indent"])
        while within and within[-1][0] >= indent:
            within.pop()
        value = (line["value"] or "").strip()
        if not value:
            within = [*within, (indent, line["key"])][:8]
            continue
        name = ".".join([*(key for _, key in within), line["key"]])
        message[name] = (
            [cell.strip() for cell in value[:1000].strip("[] ").split(",")]
            if value.startswith("[")
            else value.strip("\"'")
        )
    if message:
        yield message


_LABEL = re.compile(
    r"(?<![\w.])[\"']?([^\W\d][\w.\[\]/ ]{0,40}?)[\"']?\s*(?:\(([^\W\d][^()]{0,20})\)\s*)?"
    rf"(?:[:=](?!\d\d:)|(?=[\[({{<]\s*{NUMBER}[\s,;]))"
)
_FIND_NUMBER = re.compile(rf"(?<![\w.^]){NUMBER}(?![\w:])|(?<![\w.^]){NUMBER}(?=[^\W\d_])")
_TITLE = re.compile(r"\s*[^\W\d][\w ]*:\s*")
"""A name above the readings that belong to it."""
_QUOTED = re.compile(r'"[^"]*[:=][^"]*"')
_UNIT = re.compile(r"[\s\])}>]*[(\[]?([^\W\d_][\w/^²]*)[)\]]?[\s,;.|]*")
_STAMPS = {
    "time": re.compile(rf"\s*\[?({STAMP}Z?)\]?\s*(?:->|:|,|-|\s)"),
    "time_s": re.compile(r"(?:\[[A-Z]+\]\s*)?\[\s*(\d+\.\d+)\]"),
    "time_ms": re.compile(r"[EWIDV] \((\d+)\)\s"),
}
"""What loggers write before a line, by what it is: the Arduino's monitor and Python's logging, the
kernel and ROS, ESP-IDF."""
_AXIS = re.compile(r"(.*?)[\s_.]*([xyz])(?:[\s_-]?axis|(?<![^\W_].)\d)?", re.IGNORECASE)


class Reading(NamedTuple):
    """A number of a line: its name, the unit that is stated for it or "", and its digits."""

    name: str
    unit: str
    number: str


def is_labelled(rows: Sequence[str]) -> bool:
    """Whether one line of three, or more, names three numbers or more, or each names one."""
    plain = [row for row in rows if not _TITLE.fullmatch(row)]
    found = [[one.name for one in Scanner().scan(_QUOTED.sub("", row))] for row in plain]
    several = sum(len(names) >= 3 for names in found)
    alone = len({name for names in found for name in names}) >= 3 and all(found[:-1])
    return bool(rows) and (3 * several >= len(rows) or alone)


class Scanner:
    """Takes lines apart one after the other, and keeps the name that axes alone belong to."""

    _title = _group = _unit = ""

    def scan(self, line: str) -> list[Reading]:
        """The numbers of a line with their names; a name with two numbers behind it has none."""
        found: list[Reading] = []
        titled = ""
        line = line[:4000]  # a longer one is damage
        labels = list(_LABEL.finditer(line))
        ends = [*(label.start() for label in labels[1:]), len(line)]
        for label, end in zip(labels, ends, strict=False):
            name = label[1].strip()
            first, _, rest = label[1].partition(" ")
            sensor = len(first) == 1 and re.fullmatch(r"[xyzXYZ]", rest.strip())  # g x
            if rest and is_unit(first) and not sensor:  # of what stood before: uT Accel X
                found, name = _give_unit(found, first), rest.strip()
            content = line[label.end() : end]
            numbers = list(_FIND_NUMBER.finditer(content))
            if not numbers and not re.search(r"\w", content):
                self._set_title(name, label[2] or "")
                stated = label[2] or name.rpartition(" ")[2]
                titled = stated if is_unit(stated) else titled
            found += self._name(name, label[2] or "", [one[0] for one in numbers])
            behind = _UNIT.fullmatch(content[numbers[-1].end() :]) if numbers else None
            if behind and is_unit(behind[1]):
                found = _give_unit(found, behind[1])
        return _give_unit(found, titled) if titled else found

    def _set_title(self, name: str, unit: str) -> None:
        """Keep a name without a number, where it is that of a sensor, or comes after one."""
        column = identify_column(f"{name} x")
        if column is not None and column.rank != FALLBACK and column.axis:
            self._title, self._group, self._unit = name, "", unit
        elif self._title:  # Orient: below Mag: is another sensor's
            self._title, self._group, self._unit = name, "", ""

    def _name(self, name: str, unit: str, numbers: Sequence[str]) -> Iterator[Reading]:
        if len(numbers) == 3:
            yield from (Reading(f"{name}[{k}]", unit, number) for k, number in enumerate(numbers))
        if len(numbers) != 1:
            return
        axis = _AXIS.fullmatch(name)
        if axis is None:
            yield Reading(name, unit, numbers[0])
            return
        if axis[1] and len(axis[1]) > 1:
            self._group = axis[1].rstrip()
        elif axis[2] in "xX" and not axis[1]:
            self._group = ""
        before = "" if axis[1] else self._group or self._title
        named = f"{before} {name}" if before else name
        yield Reading(named, unit or (self._unit if before == self._title else ""), numbers[0])


def _give_unit(found: Sequence[Reading], unit: str) -> list[Reading]:
    """The readings of a line, those without a unit with this one if it can be theirs."""
    return [
        one._replace(unit=unit) if not one.unit and _may_have(one.name, unit) else one
        for one in found
    ]


@lru_cache(maxsize=1000)
def _may_have(name: str, unit: str) -> bool:
    """Whether a unit can be that of a name: none of a temperature's for an acceleration."""
    plain, column = identify_column(name), identify_column(f"{name} ({unit})")
    vague = plain is None or plain.rank == FALLBACK  # x alone: the unit says what it is
    return vague or (column is not None and column.unit is not None)


def read_labelled(rows: Sequence[str]) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """The columns of lines that name each of their numbers, and the names of the others."""
    scanner, lines, stamps = Scanner(), [], []
    clock = max(_STAMPS, key=lambda kind: sum(bool(_STAMPS[kind].match(r)) for r in rows[:SAMPLE]))
    for row in rows:
        stamp = _STAMPS[clock].match(row)
        if readings := scanner.scan(row[stamp.end() :] if stamp else row):
            lines.append(readings)
            stamps.append(stamp[1] if stamp else "")
    headers = _write_headers(lines)
    records, times = _gather(lines, stamps, headers)
    table, others = make_table(records)
    if "time" not in find_quantities(table).values() and 2 * sum(map(bool, times)) > len(times):
        kind = object if clock == "time" else float
        table[clock] = np.array([time or "nan" for time in times]).astype(kind)
    return table, others


def _write_headers(lines: Sequence[Sequence[Reading]]) -> dict[tuple[str, str], str]:
    """The header of each name with each unit; a name with and without its one unit has one. It is
    "" for counts that come with the same reading in a unit."""
    counts = Counter((one.name, one.unit) for line in lines for one in line)
    unscaled = _find_unscaled(lines)
    headers = {}
    for name, unit in counts:
        units = {other: n for (of, other), n in counts.items() if of == name and other}
        plain = identify_column(name)
        header = f"{name} ({unit})" if unit else name
        if (name, unit) in unscaled:
            header = ""
        elif plain is not None and plain.unit is not None:
            header = name  # a name that tells its unit
        elif len(units) == 1:
            ((only, times),) = units.items()
            header = f"{name} ({only})" if times >= counts[name, ""] else name
        headers[name, unit] = header
    return headers


def _find_unscaled(lines: Sequence[Sequence[Reading]]) -> set[tuple[str, str]]:
    """The names with units, or without, of counts beside the same reading in a unit. What has no
    unit is counts where it is of another size: some lines of a log may lose theirs."""
    sizes: dict[tuple[str, str], list[float]] = {}
    for line in lines:
        for one in line:
            sizes.setdefault((one.name, one.unit), []).append(abs(float(one.number)))
    usual = {named: median(values) for named, values in sizes.items()}

    def is_count(unit: str) -> bool:
        return unit.lower() in ("", "counts", "count", "raw", "lsb")

    found = set()
    for (name, unit), size in usual.items():
        scaled = [usual[of, other] for of, other in usual if of == name and not is_count(other)]
        apart = unit != "" or all(not other / 2 < size < 2 * other for other in scaled)
        if is_count(unit) and scaled and apart:
            found.add((name, unit))
    return found


def _gather(
    lines: Sequence[Sequence[Reading]], stamps: Sequence[str], headers: dict[tuple[str, str], str]
) -> tuple[list[dict[str, Any]], list[str]]:
    """The numbers by header, a record until one comes again, and the time before each."""
    records: list[dict[str, Any]] = []
    times: list[str] = []
    known = {header for header in headers.values() if header and identify_column(header)}
    for readings, stamp in zip(lines, stamps, strict=True):
        named = {header: one.number for one in readings if (header := headers[one.name, one.unit])}
        if not records or any(name in records[-1] for name in named):
            records.append({})
            times.append(stamp)
        if known.isdisjoint(records[-1]):  # so far it holds what no sensor reads
            times[-1] = stamp
        records[-1] |= named
    return records, times
