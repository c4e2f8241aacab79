"""What the lines around the rows of a text table say of them: a sampling rate, the unit of the
field, another sensor, another header, cells that hold no number; in logs of Gyroflow the factors of
counts (`t` · `tscale` is s, `gx` · `gscale` rad/s, `ax` · `ascale` g, `mx` · `mscale` G;
`timestamp` is the start in Unix seconds). Source: Gyroflow documentation, `.gcsv` format.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from agonic.errors import LogError
from agonic.logs.contents import to_number
from agonic.logs.groups import INERTIAL
from agonic.logs.headers.columns import find_named_quantity, find_quantities, identify_columns
from agonic.logs.headers.quantities import FALLBACK
from agonic.logs.log import Table as AnyTable
from agonic.logs.text.encoding import Text
from agonic.logs.text.layout import Layout, Table, is_header, split_cells
from agonic.logs.text.numbers import split_rows

_SCALES = {
    "t": ("tscale", "time_s"),
    **{f"m{axis}": ("mscale", f"mag_{axis}_G") for axis in "xyz"},
    **{f"a{axis}": ("ascale", f"acc_{axis}_g") for axis in "xyz"},
    **{f"g{axis}": ("gscale", f"gyro_{axis}_rad_s") for axis in "xyz"},
}
"""The factor of each column, and its name once that is applied."""
_NOTHING = ("", "nan", "null", "none", "na", "n/a", "#n/a", "inf", "-inf", "-")


def scale_columns(table: AnyTable, above: Sequence[str]) -> Table:
    """The columns in the units that the lines above them state; one without a factor stays."""
    pairs = (line.replace(":", ",").split(",", 1) for line in above if line.strip())
    stated = {pair[0].strip(): to_number(pair[1]) for pair in pairs if len(pair) == 2}
    scaled = {}
    for header, values in table.items():
        factor, name = _SCALES.get(header, ("", ""))
        known = np.isfinite(stated.get(factor, np.nan))
        scaled[name if known else header] = values * stated[factor] if known else values
    start = stated.get("timestamp", np.nan)
    if np.isfinite(start) and scaled:
        scaled["epoch_unix_s"] = np.full(len(next(iter(scaled.values()))), start)
    return scaled


def add_stated(table: Table, layout: Layout) -> Table:
    """The columns, with the unit and the times that lines above state where no column has them."""
    if not table:
        return table
    known, rows = find_quantities(table), len(next(iter(table.values())))
    if layout.unit and "unit" not in known.values():
        table = {**table, "unit": np.full(rows, layout.unit, dtype=object)}
    if layout.rate_Hz is None:
        return table
    clocks = {header for header, quantity in known.items() if quantity == "time"}
    empty = {h for h in clocks if table[h].dtype.kind == "f" and np.isnan(table[h]).all()}
    if clocks - empty:
        return table
    others = {header: values for header, values in table.items() if header not in empty}
    return {**others, "time_s": np.arange(rows) / layout.rate_Hz}


def check_title(table: AnyTable, lines: Sequence[str]) -> None:
    """Raise `LogError` where x, y and z stand alone and the lines above name another sensor."""
    axes = identify_columns(table).get("field", {}).get("", {})
    if not axes or any(column.rank != FALLBACK for column in axes.values()):
        return
    named = [find_named_quantity(line[:200]) for line in lines[:50]]
    if "field" not in named and not INERTIAL.keys().isdisjoint(named):
        line = next(line for line, name in zip(lines, named, strict=False) if name)
        raise LogError(
            f"its x, y and z are of no magnetometer, by the line {line.strip()[:60]!r} above them; "
            "name the file of the magnetometer"
        )


def check_numbers(table: AnyTable, data: Text, start: int, layout: Layout) -> None:
    """Raise `LogError` where no row has all axes of a magnetometer and cells are no numbers."""
    fields = [
        [axis.header for axis in axes.values()]
        for axes in identify_columns(table).get("field", {}).values()
    ]
    if any(np.isfinite([table[h] for h in headers]).all(axis=0).any() for headers in fields):
        return
    rows = [split_cells(row, layout.separator) for row in split_rows(data[: start + 20_000], start)]
    for name in (header for headers in fields for header in headers):
        at = layout.header.index(name) if name in layout.header else 0
        for cell in (row[at] for row in rows[:-1] if at < len(row)):
            if cell.lower() not in _NOTHING and math.isnan(to_number(cell)):
                raise LogError(
                    f"the cells of {name!r} hold no number that can be read, such as "
                    f"{cell[:30]!r}; write 12.5, with the unit in the header"
                )


def cut_at_header(
    table: Table, data: Text, start: int, layout: Layout
) -> tuple[Table, tuple[str, ...]]:
    """The columns as far as the header holds for their rows, and a note where another follows."""
    numbers = [values for values in table.values() if values.dtype.kind == "f"]
    empty = np.flatnonzero(np.isnan(numbers).all(axis=0)) if numbers else np.empty(0, np.int64)
    rows = split_rows(data, start) if len(empty) else []
    for at in empty[empty < len(rows)].tolist():
        if _is_other_header(layout.split(rows[at]), layout.header):
            if not at:
                break
            left = len(rows) - at - 1
            note = f"another header follows after row {at}: the {left} rows below it were not read"
            return {name: values[:at] for name, values in table.items()}, (note,)
    return table, ()


def _is_other_header(cells: Sequence[str], header: Sequence[str]) -> bool:
    """Whether cells name columns, and others than the header does."""
    if not is_header(cells) or len([q for q in find_quantities(cells).values() if q]) < 2:
        return False
    pairs = list(zip(cells, header, strict=False))
    return len(cells) != len(header) or not all(h.startswith(cell) for cell, h in pairs)
