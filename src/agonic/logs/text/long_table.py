"""Long tables: each row is of the sensor that a column names, and x, y and z are what that reads.

time,sensor,x,y,z
0.00,accelerometer,0.1,0.2,9.8
0.00,magnetometer,20.1,-3.2,43.0
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from agonic.logs.headers.columns import find_quantities, identify_column, identify_columns
from agonic.logs.headers.conventions import find_named_quantity
from agonic.logs.log import Facts, Log
from agonic.logs.table import build_log

Table = Mapping[str, NDArray[Any]]
LABEL = "sensor"

_MOST = 64
BESIDE = ("acceleration", "rotation_rate")


def build_tables_log(table: Table, **facts: Unpack[Facts]) -> Log:
    """The log that a table is, those of its sensors apart where it is a long one.

    The rest as for `build_log`.
    """
    parts = split_by_sensor(table)
    if parts is None:
        return build_log(table, **facts)
    from agonic.logs.groups import build_groups_log

    paths = {name: Path(name) for name in parts}
    return build_groups_log(parts, paths=paths, **facts)


def name_label(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """The headers, with "sensor" for a column whose cells name a magnetometer and another sensor,
    whatever it is called: rows of both must not become one sensor's.

    >>> name_label(["t", "type", "x"], [["0", "Gyroscope", "1"], ["0", "Magnetometer", "2"]])
    ['t', 'sensor', 'x']
    """
    names = list(headers)
    if LABEL in find_quantities(names).values():
        return names
    for at, name in enumerate(names):
        if identify_column(name) is not None:
            continue
        cells = {row[at].strip() for row in rows if at < len(row)}
        if len(cells) > _MOST or not any(cell[:1].isalpha() for cell in cells):
            continue
        named = {find_named_quantity(cell) for cell in cells if cell}
        if "field" in named and named & set(BESIDE):
            return [*names[:at], LABEL, *names[at + 1 :]]
    return names


def split_by_sensor(table: Table) -> dict[str, Table] | None:
    """The tables of the sensors that a long one holds; `None` where it is none.

    Rows of something that is neither a magnetometer, an accelerometer nor a gyroscope are left out.

    >>> table = {"t": np.arange(2.0), "sensor": np.array(["gyro", "mag"]), "x": np.ones(2),
    ...          "y": np.ones(2), "z": np.ones(2)}
    >>> {name: list(part) for name, part in split_by_sensor(table).items()}
    {'gyro': ['t', 'gyro x', 'gyro y', 'gyro z'], 'mag': ['t', 'x', 'y', 'z']}
    """
    found = identify_columns(table)
    label = found.get("sensor", {}).get("", {}).get("")
    bare = found.get("field", {}).get("", {})
    if label is None or set(bare) != set("xyz"):
        return None
    names = np.array([str(name).strip() for name in table[label.header]])
    quantities = {name: find_named_quantity(name) for name in np.unique(names)[:_MOST].tolist()}
    if "field" not in quantities.values() or len(set(quantities.values())) < 2:
        return None
    axes = {column.header: axis for axis, column in bare.items()}
    parts: dict[str, Table] = {}
    for name, quantity in quantities.items():
        if quantity not in ("field", *BESIDE):
            continue
        rows = names == name
        parts[name] = {
            f"{name} {axes[header]}" if header in axes and quantity != "field" else header: c[rows]
            for header, c in table.items()
            if header != label.header
        }
    return parts
