"""The directions of the field as a table."""

from __future__ import annotations

from pathlib import Path

from agonic.alignment.direction.result import FieldDirection
from agonic.alignment.files.tables import format_table
from agonic.atomic import write_atomically

DIGITS = {"unix_s": 6, "nT": 4, "deg": 7, "arcsec": 3}
"""Decimals of a column, by the unit that its name ends in: a tenth of what can be known."""


def write_direction(found: FieldDirection, file: Path) -> Path:
    """Write a row a reading that has an attitude, its columns those of `FieldDirection.columns`."""
    cells = {
        name: [f"{value:.{_count_digits(name)}f}" for value in values.tolist()]
        for name, values in found.columns().items()
    }
    return write_atomically(file, format_table(cells))


def _count_digits(name: str) -> int:
    return next(digits for unit, digits in DIGITS.items() if name.endswith(unit))
