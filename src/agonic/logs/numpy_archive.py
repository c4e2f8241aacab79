"""NumPy archives, `.npz`: arrays named as the columns of a table are; see `columns`, `arrays`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from agonic.logs.columns import refuse_many
from agonic.logs.log import Log
from agonic.logs.stacked import build_table
from agonic.logs.table import build_log
from agonic.provenance import Input

_END_BYTES = 22


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that an archive is; `unit` is that of the field where no array names one."""
    refuse_many(_count(path), "arrays")
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    table, others = build_table(arrays)
    return build_log(
        table, path=path, source=source, format="NumPy archive", unit=unit, others=others
    )


def _count(path: Path) -> int:
    """How many files the end record of the archive says there are, without reading the list."""
    with path.open("rb") as stream:
        stream.seek(-min(_END_BYTES, path.stat().st_size), 2)
        return int.from_bytes(stream.read()[10:12], "little")
