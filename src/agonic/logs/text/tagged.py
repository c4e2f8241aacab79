"""Rows of several kinds in one text file, each with its name in the first cell.

The header of a kind stands in a comment: `# UncalMag,utcTimeMillis,…` (Android GnssLogger).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from agonic.logs.groups import build_groups_log
from agonic.logs.headers.columns import find_columns, identify_column
from agonic.logs.log import Log
from agonic.logs.text.layout import Layout
from agonic.logs.text.numbers import read_numbers
from agonic.provenance import Input


def _quantity(header: str) -> str:
    column = identify_column(header)
    return "time" if column is None else column.quantity.column


def read_tagged(
    data: bytes,
    headers: Mapping[str, Sequence[str]],
    path: Path,
    source: Input,
    unit: str | None,
    notes: tuple[str, ...],
) -> Log:
    """The log that rows of several kinds are; `headers` by the name of the kind."""
    rows: dict[bytes, list[bytes]] = {name.encode(): [] for name in headers}
    for line in data.split(b"\n"):
        tag, comma, cells = line.partition(b",")
        if comma and tag in rows:
            rows[tag].append(cells)
    groups = {}
    others = []
    for name, header in headers.items():
        found = rows[name.encode()]
        wanted = find_columns(header)
        if not found or {_quantity(header) for header in wanted.values()} <= {"time"}:
            others.append(name)
            continue
        layout = Layout(separator=",", header=list(header), start=0, width=len(header))
        values = read_numbers(b"\n".join(found), 0, layout, list(wanted))
        groups[name] = dict(zip(wanted.values(), values, strict=True))
    return build_groups_log(
        groups,
        path=path,
        source=source,
        format="tagged text",
        unit=unit,
        others=others,
        notes=notes,
    )
