"""The dialects of text: rows whose layout their writer documents, and no header tells: `texts` and
`groups` in the table of dialects, `dialects.toml`.

Each kind of rows is a table. Its columns stand in the table of dialects; or in the rows themselves,
which name their cells or hold one channel each; in a comment, `# UncalMag,utcTimeMillis,…` (Android
GnssLogger), `% Magnetometer data: 'MAGN;AppTimestamp(s);…'` (GetSensorData); or in sentences,
`$COL,MAG,time,x,y,z` (FlySight). Without such, names of sensors in the first cell or the second
tell: `0.02 MAG 20.1 -3.2 43.0`.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise, zip_longest
from typing import Any, NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.contents import MOST_PARTS, to_number
from agonic.logs.groups import INERTIAL, Found
from agonic.logs.headers.columns import find_columns, find_named_quantity, read_dialects
from agonic.logs.headers.header import name_quantity
from agonic.logs.log import About
from agonic.logs.text.layout import Layout, holds_values, is_header, split_cells
from agonic.logs.text.numbers import read_numbers

Table = dict[str, Array]


class Cell(NamedTuple):
    """A cell of a row: its header, the counts of a unit, and its name in rows that name cells."""

    header: str
    counts: float = 1.0
    theirs: str = ""


class Kind(NamedTuple):
    """A kind of rows: its cells in order, and how the writer had corrected them, if it had."""

    cells: tuple[Cell, ...]
    corrected: str = ""


@dataclass(frozen=True, kw_only=True)
class Dialect:
    """How the rows of a text are known and what they hold: a row of `texts` in the table."""

    name: str
    row: str
    source: str
    kinds: Mapping[str, Kind] = field(default_factory=dict)
    above: str = ""
    bare: bool = False
    share: float = 0.5
    separator: str | None = None
    pair: str = ""
    time: str = ""
    refused: str = ""
    notes: tuple[str, ...] = ()

    def fits(self, head: Sequence[str], rows: Sequence[str]) -> bool:
        """Whether a text is of it, by its first lines and by those of them that hold values."""
        if self.above and not any(self.above in line for line in head):
            return False
        if self.bare and not (head and re.match(self.row, head[0])):
            return False
        found = [match for row in rows if (match := re.match(self.row, row))]
        if len(found) <= self.share * len(rows):
            return False
        kinds = {self.name_kind(match.groupdict().get("kind", "")) for match in found}
        cells = [cell for kind in kinds & self.kinds.keys() for cell in self.kinds[kind].cells]
        return not self.kinds or any(cell.header.startswith("mag_x") for cell in cells)

    def name_kind(self, written: str) -> str:
        """The kind of a row, as the dialect names it."""
        kind = written.strip()
        return kind if kind in self.kinds else kind.upper()


def _read_cells(cells: str) -> Iterator[Cell]:
    """The cells that are written as in the table, an asterisk for x, y and z in turn."""
    for cell in cells.split():
        name, _, counts = cell.partition("/")
        theirs, _, ours = name.rpartition("=")
        for axis in "xyz" if "*" in ours else "*":
            yield Cell(ours.replace("*", axis), float(counts or 1), theirs.replace("*", axis))


@cache
def find_group(name: str) -> dict[str, Kind]:
    """The messages of a group by their names."""
    group = read_dialects()["groups"][name]
    return {
        kind: Kind(tuple(_read_cells(cells)), corrected)
        for part, corrected in (("corrects", group["corrected"]), ("kinds", ""))
        for kind, cells in group[part].items()
    }


@cache
def list_dialects() -> tuple[Dialect, ...]:
    """The dialects of text, in the order in which they are tried."""
    found = []
    for row in read_dialects()["texts"]:
        kinds = row.get("kinds", {})
        if isinstance(kinds, str):
            known = find_group(kinds)
        else:
            known = {kind: Kind(tuple(_read_cells(cells))) for kind, cells in kinds.items()}
        found.append(Dialect(**{**row, "kinds": known}))
    return tuple(found)


_STATED = re.compile(r"[#%]\W*(?:[^'\"]*['\"])?([A-Za-z]\w+)([,;])([^'\"]*)")


def _make(
    headers: Mapping[str, Sequence[str]], at: int = 0, separator: str | None = ",", note: str = ""
) -> Dialect:
    """The dialect of rows whose kind is in the cell `at`, the first or the second."""
    cell = r"\S*" if separator is None else rf"[^{separator}\n]*"
    between = r"[^\S\n]+" if separator is None else separator
    before = rf"(?P<before>{cell}){between}" * at
    return Dialect(
        name="tagged text",
        row=rf"[^\S\n]*{before}(?P<kind>{cell}){between}(?P<cells>.*)",
        kinds={name: Kind(tuple(map(Cell, header))) for name, header in headers.items()},
        separator=separator,
        source="the text itself",
        notes=(note,) if note else (),
    )


def find_stated_dialect(head: Sequence[str]) -> Dialect | None:
    """The dialect that the first lines of a text show, if any."""
    if any(line.startswith("$COL,") for line in head):
        return _make(find_stated_columns(head))
    rows = [line for line in head if holds_values(line)]
    return _find_commented(head, rows) or _find_named(rows)


def _find_commented(head: Sequence[str], rows: Sequence[str]) -> Dialect | None:
    """Those whose headers are in comments."""
    stated = [found for line in head if (found := _STATED.match(line))]
    for separator in (",", ";"):
        first: dict[str, str] = {}
        for row in rows:
            first.setdefault(row.partition(separator)[0], row)
        headers = {}
        for found in stated:
            names = [name.strip() for name in found[3].split(separator)]
            if found[2] == separator and len(names) > 2:
                more = len(names) > first.get(found[1], "").count(separator)
                headers[found[1]] = [name for name in names if name or not more]
        begun = headers.keys() & first
        if len(begun) > 1 or (begun and (len(headers) > 1 or first.keys() <= begun)):
            return _make(headers, separator=separator)
    return None


def _find_named(rows: Sequence[str]) -> Dialect | None:
    """Those that are named for sensors, without a header."""
    for separator, at in ((s, at) for s in (";", ",", "\t", None) for at in (0, 1)):
        kinds: dict[str, list[list[str]]] = defaultdict(list)
        for row in rows:
            cells = split_cells(row, separator)
            if at < len(cells) and cells[at][:1].isalpha():
                kinds[cells[at]].append(cells[:at] + cells[at + 1 :])
        known = {name: find_named_quantity(name) for name in kinds}
        if "field" not in known.values() or is_header(kinds[next(iter(kinds))][0]):
            continue
        sensors = [name for name, quantity in known.items() if quantity in ("field", *INERTIAL)]
        named = {name: head for name in sensors if (head := _name_cells(name, kinds[name]))}
        field = next((name for name in named if known[name] == "field"), None)
        if field is not None:
            words = ", ".join(name for name in named[field] if name)
            note = f"there is no header: rows of {', '.join(named)} are taken as {words}"
            return _make(named, at, separator, note)
    return None


def _name_cells(kind: str, rows: Sequence[Sequence[str]]) -> list[str]:
    """A header for rows of a kind: clocks first, three axes, and behind them what never changes;
    nothing where that is not what they are."""
    columns = list(zip(*rows, strict=False))
    width = len(columns)
    growing = [all(a < b for a, b in pairwise(map(to_number, column))) for column in columns[:-3]]
    clocks = growing.index(False) if False in growing else max(width - 3, 0)
    behind = columns[clocks + 3 :]
    if width < 3 or any(len(set(column)) > 1 for column in behind):
        return []
    axes = [f"{kind} {axis}" for axis in "xyz"]
    return [*["time"][:clocks], *[""] * (clocks - 1), *axes, *[""] * len(behind)]


def find_stated_columns(lines: Iterable[str]) -> dict[str, list[str]]:
    """The headers of sentences whose columns and units are stated before them, as FlySight does."""
    stated: dict[str, dict[str, list[str]]] = {"$COL": {}, "$UNIT": {}}
    for line in lines:
        what, *cells = (cell.strip() for cell in line.split(","))
        if what in stated and len(cells) > 1:
            stated[what][cells[0]] = cells[1:]
    headers = {}
    for kind, names in stated["$COL"].items():
        units = stated["$UNIT"].get(kind, [])
        spelled = (f"{kind} {name}" if name in ("x", "y", "z") else name for name in names)
        headers[f"${kind}"] = [
            f"{name} ({unit})" if unit else name
            for name, unit in zip_longest(spelled, units[: len(names)], fillvalue="")
        ]
    return headers


def read_dialect(dialect: Dialect, text: str) -> Found:
    """The columns of each kind of rows that a text has."""
    if dialect.refused:
        raise LogError(f"this is {dialect.refused}")
    about: About = {"format": dialect.name, "notes": dialect.notes}
    if not dialect.kinds:
        tables, about["others"] = _read_named(dialect, text)
        return Found(tables, about)
    tables = {}
    for name, rows in _split_by_kind(dialect, text).items():
        if (kind := dialect.kinds.get(name)) is not None:
            tables[name.lstrip("$")] = _read_kind(kind, rows, dialect)
    return Found(tables, about, {name: kind.corrected for name, kind in dialect.kinds.items()})


def _read_kind(kind: Kind, rows: Sequence[str], dialect: Dialect) -> Table:
    """The columns of the rows of a kind."""
    if dialect.pair:
        return name_cells(kind, [dict(re.findall(dialect.pair, row)) for row in rows])
    headers = [cell.header for cell in kind.cells]
    wanted = find_columns(headers)
    layout = Layout(separator=dialect.separator, header=headers, start=0, width=len(headers))
    values = read_numbers("\n".join(rows).encode(), 0, layout, list(wanted))
    return {
        header: column / kind.cells[at].counts
        for (at, header), column in zip(wanted.items(), values, strict=True)
    }


def _read_named(dialect: Dialect, text: str) -> tuple[dict[str, Any], list[str]]:
    """The columns of rows that name their cells, by what the rows are named for, and the names of
    the other columns: cells in pairs or in JSON, or of one channel each, by `name` and `unit`."""
    from agonic.logs.text.records import gather_channels, make_table, name_unit

    records: dict[str, list[dict[str, Any]]] = defaultdict(list)
    channels: list[tuple[str, str, str]] = []
    for match in re.finditer(f"^(?:{dialect.row})", text, re.MULTILINE):
        said = match.groupdict("")
        if "name" in said:
            name = name_unit(said["name"].strip(), said.get("unit", "").strip())
            pairs = re.findall(dialect.pair, said["cells"])
            channels += ((time or said.get("time", ""), name, value) for time, value in pairs)
        elif cells := _take_apart(said["cells"], dialect.pair):
            if said["time"] and "time" not in map(name_quantity, cells):
                cells[dialect.time] = said["time"]
            records[said["kind"]].append(cells)
    if len(records) > MOST_PARTS:  # what stands before the objects counts or dates them
        records = {"": [one for rows in records.values() for one in rows]}
    if channels:
        records[""] = gather_channels(channels, dialect.time)
    if not records:
        raise LogError("no row in it is whole; fetch the file again")
    measured = Counter(kind.partition(",")[0] for kind in records)  # without its tags
    tables, others = {}, []
    for kind, rows in records.items():
        measurement = kind.partition(",")[0]
        table, more = make_table(rows)
        tables[measurement if measured[measurement] == 1 else kind] = table
        others += more
    return {"" if len(tables) == 1 else name: table for name, table in tables.items()}, others


def _take_apart(cells: str, pair: str) -> dict[str, Any]:
    """The values in a row by their names; none in a damaged one."""
    if pair:
        return dict(re.findall(pair, cells))
    import msgspec

    with suppress(msgspec.DecodeError, RecursionError):
        found = msgspec.json.decode(cells)
        return found if isinstance(found, dict) else {}
    return {}


def _split_by_kind(dialect: Dialect, text: str) -> dict[str, list[str]]:
    """The cells of the rows of each kind, those before the kind first."""
    pattern = re.compile(f"^(?:{dialect.row})", re.MULTILINE)
    groups, rows = pattern.groupindex, pattern.findall(text)
    if len(groups) == 1:
        return {"": rows}
    kind, before, cells = (groups.get(part, 0) - 1 for part in ("kind", "before", "cells"))
    between = dialect.separator or " "
    found: dict[str, list[str]] = defaultdict(list)
    for row in rows:
        written = row[cells] if before < 0 else f"{row[before]}{between}{row[cells]}"
        found["" if kind < 0 else row[kind]].append(written)
    return {dialect.name_kind(name): some for name, some in found.items()}


def name_cells(kind: Kind, rows: Sequence[Mapping[str, Any]]) -> Table:
    """The columns of rows of a kind that name their cells; what none has is left out."""
    columns = {
        cell.header: np.array([to_number(row.get(cell.theirs, "")) for row in rows]) / cell.counts
        for cell in kind.cells
    }
    return {header: values for header, values in columns.items() if np.isfinite(values).any()}
