"""What the lines before a table state of all its rows: a sampling rate, the unit of the field, and
in logs of Gyroflow the factors of counts.

Source: Gyroflow documentation, `.gcsv` format: `t` times `tscale` is seconds, `gx` times `gscale`
rad/s, `ax` times `ascale` g, `mx` times `mscale` gauss; `timestamp` is the start in Unix seconds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.logs.contents import to_number
from agonic.logs.headers.columns import find_quantities
from agonic.logs.text.layout import Layout, Table

_SCALES = {
    "t": ("tscale", "time_s"),
    **{f"m{axis}": ("mscale", f"mag_{axis}_G") for axis in "xyz"},
    **{f"a{axis}": ("ascale", f"acc_{axis}_g") for axis in "xyz"},
    **{f"g{axis}": ("gscale", f"gyro_{axis}_rad_s") for axis in "xyz"},
}
"""The factor of each column, and its name once that is applied."""


def scale_columns(
    table: Mapping[str, NDArray[Any]], above: Sequence[str]
) -> dict[str, NDArray[Any]]:
    """The columns in the units that the lines above them state; one without a factor stays.

    >>> scale_columns({"t": np.array([0, 5])}, ["tscale,0.001"])["time_s"].tolist()
    [0.0, 0.005]
    """
    pairs = (line.replace(":", ",").split(",", 1) for line in above if line.strip())
    stated = {pair[0].strip(): to_number(pair[1]) for pair in pairs if len(pair) == 2}
    scaled = {}
    for header, values in table.items():
        factor, name = _SCALES.get(header, ("", ""))
        if np.isfinite(stated.get(factor, np.nan)):
            scaled[name] = values * stated[factor]
        else:
            scaled[header] = values
    start = stated.get("timestamp", np.nan)
    if np.isfinite(start) and scaled:
        scaled["epoch_unix_s"] = np.full(len(next(iter(scaled.values()))), start)
    return scaled


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
