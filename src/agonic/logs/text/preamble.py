"""What the lines before a table state of all its rows: a sampling rate, the unit of the field."""

from __future__ import annotations

import numpy as np

from agonic.logs.headers.columns import find_quantities
from agonic.logs.text.layout import Layout, Table


def add_stated(table: Table, layout: Layout) -> Table:
    """The columns, with a unit and times from those lines where no column tells them."""
    if layout.unit and table and "unit" not in find_quantities(table).values():
        rows = len(next(iter(table.values())))
        table = {**table, "unit": np.full(rows, layout.unit, dtype=object)}
    return _add_rate(table, layout)


def _add_rate(table: Table, layout: Layout) -> Table:
    """The columns, with times from the sampling rate where no column is a clock."""
    if layout.rate_Hz is None or not table:
        return table
    clocks = {h for h, quantity in find_quantities(table).items() if quantity == "time"}
    empty = {h for h in clocks if table[h].dtype.kind == "f" and np.isnan(table[h]).all()}
    if clocks - empty:
        return table
    rows = len(next(iter(table.values())))
    others = {header: values for header, values in table.items() if header not in empty}
    return {**others, "time_s": np.arange(rows) / layout.rate_Hz}
