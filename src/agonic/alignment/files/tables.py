"""Tables of a session as CSV: columns by header, numbers that are checked, and their writing."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.contents import read_text
from agonic.logs.rows.auxiliary import to_numbers

GON_DEG = 0.9


@dataclass(frozen=True)
class Table:
    """The columns of a table as text, by header, and where it was read."""

    columns: Mapping[str, list[str]]
    path: Path

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def read_numbers(self, name: str) -> Array:
        """A column of numbers; the first that is none is an error."""
        values = to_numbers(np.array(self.columns[name]))
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            row, cell = int(bad[0]), self.columns[name][int(bad[0])]
            raise LogError(f"{name} is {cell!r}, no number", path=self.path, row=row + 2)
        return values

    def read_angles(self, names: Iterable[str]) -> dict[str, Array]:
        """Columns of numbers by name; those in degrees may stand in gon. All missing are named."""
        in_gon = {name: name.replace("_deg", "_gon") for name in names}
        missing = [name for name, gon in in_gon.items() if not {name, gon} & set(self.columns)]
        if missing:
            raise LogError(
                f"has no column {', '.join(missing)} among {', '.join(self.columns)}",
                path=self.path,
            )
        return {
            name: self.read_numbers(name) if name in self else GON_DEG * self.read_numbers(gon)
            for name, gon in in_gon.items()
        }

    def find(self, names: tuple[str, ...], what: str) -> str:
        """The first of several names that is there."""
        found = next((name for name in names if name in self), None)
        if found is None:
            raise LogError(
                f"no column with {what} ({' or '.join(names)}) among {', '.join(self.columns)}",
                path=self.path,
            )
        return found


def read_table(path: Path, needed: str) -> Table:
    """The columns by header; `needed` says what the table should be, for an error."""
    text = read_text(path, needed)
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    rows = list(csv.reader(lines))
    if len(rows) < 2:
        raise LogError(f"there is no row below a header; {needed} is needed", path=path)
    header = [name.strip() for name in rows[0]]
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            raise LogError(f"{len(row)} cells below {len(header)} columns", path=path, row=number)
    return Table(
        {name: [row[k].strip() for row in rows[1:]] for k, name in enumerate(header)}, path
    )


def format_table(columns: Mapping[str, Iterable[Any]]) -> str:
    """Columns of cells as CSV; numbers to their last digit."""
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    cells = (c.tolist() if isinstance(c, np.ndarray) else c for c in columns.values())
    writer.writerows(zip(*cells, strict=True))
    return stream.getvalue()
