"""Rows of several kinds in one text file, each with its name in the first cell.

The header of a kind stands in a comment: `# UncalMag,utcTimeMillis,…` (Android GnssLogger), or in
sentences of its own: `$COL,MAG,time,x,y,z` (FlySight).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import zip_longest
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


def find_stated_columns(lines: Iterable[str]) -> dict[str, list[str]]:
    """The headers of sentences whose columns and units are stated before them, as FlySight does.

    >>> find_stated_columns(["$COL,MAG,time,x,y,z", "$UNIT,MAG,s,gauss,gauss,gauss", "$DATA"])
    {'$MAG': ['time (s)', 'MAG x (gauss)', 'MAG y (gauss)', 'MAG z (gauss)']}
    """
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
        groups[name.lstrip("$")] = dict(zip(wanted.values(), values, strict=True))
    return build_groups_log(
        groups,
        path=path,
        source=source,
        format="tagged text",
        unit=unit,
        others=others,
        notes=notes,
    )
