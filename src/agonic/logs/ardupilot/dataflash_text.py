"""The text form of ArduPilot dataflash logs, taken apart into tables.

The lines of a `.log` file are the messages of a `.bin` file: a name, then values that are scaled
already. Lines `FMT, type, length, name, letters, columns…` say what each name holds.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.logs.ardupilot.dataflash_binary import INTEGERS, TEXTS, Content, Table, describe_stream
from agonic.logs.contents import to_number

Lines = list[tuple[int, list[str]]]


def read_text(path: Path, wanted: Collection[str]) -> Content:
    """The wanted messages of a `.log` file; lines that are too short are left out."""
    lines: dict[str, Lines] = {}
    for number, line in enumerate(path.read_text("latin-1").splitlines()):
        name, *values = (part.strip() for part in line.split(","))
        lines.setdefault(name, []).append((number, values))
    tables = {}
    for _, (_, _, name, letters, *columns) in _whole(lines.get("FMT", []), 5):
        if rows := _whole(lines.get(name, []), len(columns)):
            tables[name] = _table(rows, letters, columns)
    return Content(
        {name: tables[name] for name in wanted if name in tables},
        tuple(describe_stream(name, table) for name, table in tables.items()),
    )


def _whole(lines: Lines, n: int) -> Lines:
    return [(number, values) for number, values in lines if len(values) >= n]


def _table(lines: Lines, letters: str, names: list[str]) -> Table:
    columns: dict[str, NDArray[Any]] = {}
    for k, (letter, name) in enumerate(zip(letters, names, strict=False)):
        column = [values[k] for _, values in lines]
        texts = letter in TEXTS + "M"  # modes are written by name
        columns[name] = np.array([v.encode() for v in column] if texts else _numbers(column))
    integer = (n for n, letter in zip(names, letters, strict=False) if letter in INTEGERS)
    return Table(np.array([number for number, _ in lines]), columns, frozenset(integer))


def _numbers(column: list[str]) -> list[float]:
    """The values as numbers, NaN where a damaged line holds something else."""
    try:
        return [float(value) for value in column]
    except ValueError:
        return [to_number(value) for value in column]
