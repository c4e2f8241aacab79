"""The dialects of text: rows whose layout their writer documents, and no header tells.

They are `texts` and `groups` in the table of dialects, `dialects.toml`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

from agonic.logs.headers.conventions import read_dialects


class Cell(NamedTuple):
    """A cell of a row: its header, the counts of a unit, and its name in rows that name cells."""

    header: str
    counts: float = 1.0
    theirs: str = ""


class Kind(NamedTuple):
    """A kind of rows: its cells in order, and how the writer had corrected them, if it had."""

    cells: tuple[Cell, ...]
    corrected: str = ""


def _read_cells(cells: str) -> Iterator[Cell]:
    """The cells that are written as in the table, an asterisk for x, y and z in turn.

    >>> [cell.header for cell in _read_cells("time_s mag_*_mG/10")]
    ['time_s', 'mag_x_mG', 'mag_y_mG', 'mag_z_mG']
    """
    for cell in cells.split():
        name, _, counts = cell.partition("/")
        theirs, _, ours = name.rpartition("=")
        for axis in "xyz" if "*" in ours else "":
            yield Cell(ours.replace("*", axis), float(counts or 1), theirs.replace("*", axis))
        if "*" not in ours:
            yield Cell(ours, float(counts or 1), theirs)


@cache
def find_group(name: str) -> dict[str, Kind]:
    """The messages of a group by their names.

    >>> find_group("MAVLink")["ATTITUDE"].cells[1]
    Cell(header='roll_rad', counts=1.0, theirs='roll')
    """
    group = read_dialects()["groups"][name]
    said = {"corrects": group["corrected"], "kinds": ""}
    return {
        kind: Kind(tuple(_read_cells(cells)), corrected)
        for part, corrected in said.items()
        for kind, cells in group[part].items()
    }


@dataclass(frozen=True, kw_only=True)
class Dialect:
    """How the rows of a text are known and what they hold: a row of `texts` in the table."""

    name: str
    row: str
    kinds: Mapping[str, Kind]
    source: str
    above: str = ""
    share: float = 0.5
    separator: str | None = None
    pair: str = ""


def _make_dialect(row: Mapping[str, Any]) -> Dialect:
    kinds = row["kinds"]
    if isinstance(kinds, str):
        known = find_group(kinds)
    else:
        known = {kind: Kind(tuple(_read_cells(cells))) for kind, cells in kinds.items()}
    return Dialect(**{**row, "kinds": known})


@cache
def list_dialects() -> tuple[Dialect, ...]:
    """The dialects of text, in the order in which they are tried."""
    return tuple(map(_make_dialect, read_dialects()["texts"]))


def find_dialect(head: Sequence[str], rows: Sequence[str]) -> Dialect | None:
    """The dialect of a text by its first lines, and by those of them that hold values."""
    return next((dialect for dialect in list_dialects() if _fits(dialect, head, rows)), None)


def _fits(dialect: Dialect, head: Sequence[str], rows: Sequence[str]) -> bool:
    if dialect.above and not any(dialect.above in line for line in head):
        return False
    found = [match for row in rows if (match := re.match(dialect.row, row))]
    kinds = {name_kind(match.groupdict().get("kind", ""), dialect) for match in found}
    known = [dialect.kinds[kind] for kind in kinds & dialect.kinds.keys()]
    field = any(cell.header.startswith("mag_x") for kind in known for cell in kind.cells)
    return field and len(found) > dialect.share * len(rows)


def name_kind(written: str, dialect: Dialect) -> str:
    """The kind of a row, as the dialect names it."""
    kind = written.strip()
    return kind if kind in dialect.kinds else kind.upper()
