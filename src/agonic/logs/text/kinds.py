"""Rows of documented dialects made into tables, one for each kind of rows."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from agonic.arrays import Array
from agonic.logs.contents import to_number
from agonic.logs.groups import build_groups_log
from agonic.logs.headers.columns import find_columns, find_quantities
from agonic.logs.log import Facts, Log
from agonic.logs.table import build_log
from agonic.logs.text.dialects import Dialect, Kind, name_kind
from agonic.logs.text.layout import Layout
from agonic.logs.text.numbers import read_numbers
from agonic.samples import Samples

Table = dict[str, Array]


def read_dialect(dialect: Dialect, text: str) -> dict[str, Table]:
    """The columns of each kind of rows that a text has."""
    read = _read_cells if dialect.pair is None else _read_pairs
    return {
        name: read(dialect, dialect.kinds[name], rows)
        for name, rows in _split_by_kind(dialect, text).items()
        if name in dialect.kinds
    }


def _split_by_kind(dialect: Dialect, text: str) -> dict[str, list[str]]:
    """The cells of the rows of each kind, those before the kind first."""
    groups = dialect.row.groupindex
    rows = re.compile(f"^(?:{dialect.row.pattern})", re.MULTILINE).findall(text)
    if len(groups) == 1:
        return {"": rows}
    kind, before, cells = (groups.get(part, 0) - 1 for part in ("kind", "before", "cells"))
    between = dialect.separator or " "
    found: dict[str, list[str]] = defaultdict(list)
    for row in rows:
        written = row[cells] if before < 0 else f"{row[before]}{between}{row[cells]}"
        found["" if kind < 0 else row[kind]].append(written)
    return {name_kind(name, dialect): some for name, some in found.items()}


def _read_cells(dialect: Dialect, kind: Kind, rows: Sequence[str]) -> Table:
    """The columns of cells in a known order."""
    headers = [cell.header for cell in kind.cells]
    wanted = find_columns(headers)
    layout = Layout(separator=dialect.separator, header=headers, start=0, width=len(headers))
    values = read_numbers("\n".join(rows).encode(), 0, layout, list(wanted))
    return {
        header: column / kind.cells[at].counts
        for (at, header), column in zip(wanted.items(), values, strict=True)
    }


def _read_pairs(dialect: Dialect, kind: Kind, rows: Sequence[str]) -> Table:
    """The columns of cells that are named."""
    assert dialect.pair is not None
    cells = [dict(found) for found in map(dialect.pair.findall, rows)]
    columns = {
        cell.header: np.array([to_number(row.get(cell.theirs, "")) for row in cells]) / cell.counts
        for cell in kind.cells
    }
    return {header: values for header, values in columns.items() if np.isfinite(values).any()}


def build_dialect_log(dialect: Dialect, text: str, facts: Facts) -> Log:
    """The log that rows of a dialect are."""
    tables = read_dialect(dialect, text)
    if "" in tables:
        log = build_log(tables[""], **facts)
    else:
        others = [name for name, table in tables.items() if _holds_times_alone(table)]
        groups = {name.lstrip("$"): table for name, table in tables.items() if name not in others}
        log = build_groups_log(groups, others=others, **facts)
    return replace(log, sensors=tuple(_mark(one, dialect) for one in log.sensors))


def _holds_times_alone(table: Table) -> bool:
    return {*find_quantities(table).values()} <= {"time"}


def _mark(samples: Samples, dialect: Dialect) -> Samples:
    kind = dialect.kinds.get(samples.name.partition(" ")[0])
    return samples if kind is None else mark_corrected(samples, kind.corrected)


def mark_corrected(samples: Samples, how: str) -> Samples:
    """The readings, with a note on how their writer had corrected them, if it had."""
    return replace(samples, corrected=True, notes=(*samples.notes, how)) if how else samples
