"""The quantities that a table of readings can hold, and the names and units loggers give them.

They are rows of `quantities.toml`, which says what each part of a row is.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

DOCUMENT: Mapping[str, Any] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))

Linear = tuple[float, float]
"""Ours = factor × theirs + offset."""


def _spell(units: str | Mapping[str, Any]) -> dict[str, Linear]:
    """The factor, and the offset, of each spelling of a unit, or of those of a named table."""
    spellings = DOCUMENT["units"][units] if isinstance(units, str) else units
    return {
        word: tuple(linear) if isinstance(linear, list) else (linear, 0.0)
        for words, linear in spellings.items()
        for word in words.split()
    }


TIMES = _spell("time")
# fmt: off
FIELD_UNITS = (
    "nt", "nanotesla", "gamma", "ut", "microtesla", "mt", "millitesla", "t", "tesla", "g", "gs",
    "gauss", "ga", "microt", "utesla", "au", "mg", "mgauss", "milligauss", "mga", "mgs",
    "raw", "counts", "count", "lsb",
)
# fmt: on


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """What a column can hold, and how it is called: a row of `quantities.toml`."""

    column: str
    name: str
    unit: str = ""
    aliases: str = ""
    weak: str = ""
    last: str = ""
    preferred: str = ""
    units: Mapping[str, Linear] = field(default_factory=dict)
    axes: str = ""

    @property
    def vector(self) -> bool:
        """Whether it has components."""
        return bool(self.axes)


def _make_quantity(row: Mapping[str, Any]) -> Quantity:
    texts = {part: " ".join(text.split()) for part, text in row.items() if part != "units"}
    return Quantity(**texts, units=_spell(row.get("units", {})))


QUANTITIES = tuple(map(_make_quantity, DOCUMENT["quantities"]))
DISTURBER = _make_quantity(DOCUMENT["disturber"])
"""Whatever may disturb: any name with one of these units behind it, in these letters."""
DISTURBER_UNITS = {"mA": "A", "mW": "W", "percent": "duty", "pwm_us": "duty"}
"""The unit in which a disturber is kept that was recorded in another: duty is 0…1, of 1…2 ms."""

BY_COLUMN = {quantity.column: quantity for quantity in QUANTITIES}


def canonical_header(column: str, axis: str = "", unit: str | None = None) -> str:
    """The name that `write_csv` gives to a column; the field's carries the unit of the samples.

    >>> canonical_header("field", "x", "nT"), canonical_header("acceleration", "z")
    ('mag_x_nT', 'acc_z_m_s2')
    """
    quantity = BY_COLUMN[column]
    written = unit or "" if column in ("field", "second") else quantity.unit
    return "_".join(part for part in (quantity.name, axis, written) if part)
