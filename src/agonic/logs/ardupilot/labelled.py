"""ArduPilot logs as Mission Planner and pymavlink export them to MATLAB: `MAG` with `MAG_label`.

Each message is a matrix, a row a message, with the names of its columns in a cell array of texts;
`PARM` is a cell array of names and values. The readings are those of the dataflash log: milligauss,
body axes, corrected by the autopilot. Source: ArduPilot/MissionPlanner, Log/MatLab.cs.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from agonic.logs.ardupilot.dataflash import MAGNETOMETERS, WANTED, build_tables_log
from agonic.logs.ardupilot.dataflash_binary import Content, Table, describe_stream
from agonic.logs.log import Log
from agonic.provenance import Input

_LABEL = "_label"
_LINE = ("LineNo", "linenumber", "Line")


def is_labelled(contents: Mapping[str, Any]) -> bool:
    """Whether the variables of a file are messages with labels, one of them a magnetometer's."""
    names = (*MAGNETOMETERS, *(f"MAG_{k}" for k in range(4)))
    return any(name in contents and f"{name}{_LABEL}" in contents for name in names)


def read_labelled(contents: Mapping[str, Any], path: Path, source: Input) -> Log:
    """The log that messages with labels are."""
    tables: dict[str, Table] = {}
    notes: tuple[str, ...] = ()
    for name, values in contents.items():
        labels = contents.get(f"{name}{_LABEL}")
        table = _make_table(values, labels) if labels is not None else None
        if table is not None:
            tables[name] = table
    if (parameters := _read_parameters(contents.get("PARM"))) is not None:
        tables["PARM"] = parameters
    elif "PARM" not in tables:
        notes = ("no parameters in the file: corrections beside the offsets are not known",)
    tables = _join_instances(tables)
    streams = tuple(describe_stream(name, table) for name, table in tables.items())
    wanted = {name: table for name, table in tables.items() if name in WANTED}
    content = Content(wanted, streams, notes)
    return build_tables_log(content, path, source, "ArduPilot log in MATLAB")


def _make_table(values: Any, labels: Any) -> Table | None:
    """The table of one message; `None` where matrix and labels do not fit."""
    if not isinstance(values, np.ndarray) or not isinstance(labels, list):
        return None
    names = [label.strip() for label in labels if isinstance(label, str)]
    rows = np.atleast_2d(values).astype(np.float64)
    if len(names) != len(labels) or rows.ndim != 2 or rows.shape[1] != len(names):
        return None
    columns = dict(zip(names, rows.T, strict=True))
    line = next((columns.pop(name) for name in _LINE if name in columns), np.arange(len(rows)))
    return Table(line.astype(np.int64), columns)


def _read_parameters(cells: Any) -> Table | None:
    """The table of the parameters in a cell array, names first, all from the start of the log."""
    if not isinstance(cells, list):
        return None
    names = [cell.strip().encode() for cell in cells if isinstance(cell, str)]
    values = [float(cell) for cell in cells if isinstance(cell, np.ndarray) and cell.size == 1]
    if not names or len(names) != len(values):
        return None
    columns = {"Name": np.array(names), "Value": np.array(values)}
    return Table(np.zeros(len(names), np.int64), columns)


def _join_instances(tables: Mapping[str, Table]) -> dict[str, Table]:
    """The tables, with `NAME_0`, `NAME_1` as one table whose column `I` tells them apart."""
    joined = dict(tables)
    for first in [name for name in tables if name.endswith("_0")]:
        stem = first.removesuffix("_0")
        parts = [tables[f"{stem}_{k}"] for k in range(8) if f"{stem}_{k}" in tables]
        shared = set.intersection(*(set(part.columns) for part in parts))
        numbers = np.concatenate([np.full(len(part), float(k)) for k, part in enumerate(parts)])
        columns = {c: np.concatenate([part.columns[c] for part in parts]) for c in shared}
        position = np.concatenate([part.position for part in parts])
        joined.setdefault(stem, Table(position, {**columns, "I": numbers}))
    return joined
