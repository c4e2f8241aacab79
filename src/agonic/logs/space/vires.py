"""Text tables of the VirES service: satellite variables with vectors in braces, `{1;2;3}`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.logs.clocks.clock import UNIX, read_clock, to_moments
from agonic.logs.contents import to_number
from agonic.logs.headers.columns import refuse_many
from agonic.logs.log import Log
from agonic.logs.space.variables import build_variables_log
from agonic.provenance import Input

_TIME, _CRAFT = "Timestamp", "Spacecraft"


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that such a table is; the service writes nT, degrees and metres.

    Raises `LogError` where no vector is one of a magnetometer.
    """
    header, *lines = path.read_bytes().decode("latin-1").replace("\r\n", "\n").split("\n")
    names = header.split(",")
    refuse_many(len(names))
    rows = [cells for line in lines if len(cells := line.split(",")) == len(names)]
    lost = sum(bool(line.strip()) for line in lines) - len(rows)
    if not rows:
        raise LogError("there is a header and no whole row below it; fetch it again")
    notes = (f"{lost} rows are not whole: left out",) if lost else ()
    variables = {
        name: _column(name, cells)
        for name, cells in zip(names, zip(*rows, strict=True), strict=True)
    }
    return build_variables_log(
        {name: values for name, values in variables.items() if values is not None},
        {},
        path=path,
        source=source,
        format="VirES text table",
        unit=unit,
        notes=notes,
    )


def _column(name: str, cells: tuple[str, ...]) -> NDArray[Any] | None:
    """Moments, texts, vectors (n, k) or numbers; `None` where vectors differ in length."""
    if name == _CRAFT:
        return np.array(cells, dtype=object)
    if name == _TIME:
        seconds, epoch, _ = read_clock(np.array(cells, dtype=object), None)
        if seconds is None or epoch is None:
            raise LogError(f"the time {cells[0][:40]!r} cannot be read; fetch the file again")
        return to_moments((seconds + (epoch - UNIX).total_seconds()) * 1e6)
    parts = [cell.strip("{} ").split(";") for cell in cells]
    width = max(set(map(len, parts)), key=[len(p) for p in parts].count)
    values = [[to_number(x) for x in p] if len(p) == width else [np.nan] * width for p in parts]
    return np.array(values)[:, 0] if width == 1 else np.array(values)
