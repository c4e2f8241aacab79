"""Units, clocks and quaternions that a format fixes in its documents, where its headers do not.

A format is known by marks among its headers; nothing is taken from the size of the numbers. A unit
that is given goes before a documented one, since drivers do not always keep to the documents.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

from agonic.errors import LogError
from agonic.logs.headers.columns import Identified, map_columns
from agonic.logs.headers.header import Column, identify_column
from agonic.logs.headers.quantities import BY_COLUMN, FALLBACK

_OTHERS = (
    r"^(gravity|orientation|linear[ _-]?acc|gamerotation|rotation[ _-]?vector|location|velocity)"
)
"""Files of phones with x, y and z of something else."""


@dataclass(frozen=True, kw_only=True)
class Convention:
    """A format of tables: a row of `tables` in `dialects.toml`, which says what each part is."""

    name: str
    marks: Sequence[str]
    units: Mapping[str, str] = field(default_factory=dict)
    columns: Mapping[str, str] = field(default_factory=dict)
    above: str = ""
    file: str = ""
    only: str = ""
    source: str = field(default="", compare=False)

    def fits(self, headers: Iterable[str], stem: str, title: str = "") -> bool:
        """Whether a table with these headers, in a file of that name, is of the format."""
        text = "\n".join(["", *headers, ""])
        found = (
            f"\n{name}\n" in text  # ^name$, which costs no compiling
            if (name := mark[1:-1]).isidentifier()
            else re.search(mark, text, re.MULTILINE)
            for mark in self.marks
        )
        return self.above in title and all(found) and bool(re.search(self.file, stem, re.I))


CORRECTED = "MAG of ArduPilot, already corrected by the autopilot; read its own log (.bin)"
OFFSETS = {"MagX", "OfsX", "MOX"}
"""Columns of the message MAG: its field has had the offsets added, and the motor term."""

_CORRECTED = re.compile(
    r"^Shimmer_\w+_CAL\b|^(?:motionMagneticField|locationHeading)[XYZ]\b|IMU\d?\.[xyz]mag$"
)
"""Fields that a device has corrected: Shimmer, iOS (Core Motion, Core Location), MAVLink."""
OF_DEVICE = (
    "the device had corrected these readings ({}); record uncorrected ones, if it gives them"
)


@cache
def read_dialects() -> dict[str, Any]:
    """The table of dialects, `dialects.toml`: rows of tables, of texts, and groups of messages."""
    return tomllib.loads((Path(__file__).parents[1] / "dialects.toml").read_text("utf-8"))


@cache
def list_conventions() -> tuple[Convention, ...]:
    """The formats of tables that document what their headers do not tell."""
    return tuple(Convention(**row) for row in read_dialects()["tables"])


def apply_conventions(
    found: Identified, headers: Iterable[str], stem: str
) -> tuple[Identified, tuple[str, ...]]:
    """The columns, with the units that the format of the table documents; and notes. `stem` is the
    name of the file without its ending, which tells what bare x, y and z are."""
    headers = list(headers)
    _refuse_other_sensor(found, stem)
    known = [one for one in list_conventions() if one.units and one.fits(headers, stem)]
    used: dict[str, list[str]] = {}

    def complete(column: Column) -> Column:
        """A column with the first unit that its format documents, if it names none itself."""
        quantity = column.quantity
        for one in known if column.unit is None else ():
            if quantity.column in one.units and re.search(one.only, column.header):
                used.setdefault(one.name, []).append(quantity.name)
                return replace(column, unit=one.units[quantity.column], documented=one.name)
        return column

    return map_columns(found, complete), tuple(
        f"{', '.join(dict.fromkeys(names))}: units as {format} documents"
        for format, names in used.items()
    )


def name_documented(headers: Sequence[str], title: str = "") -> list[str]:
    """The headers, those by canonical names that only the format of the table tells, or the lines
    above it."""
    known: dict[str, str] = {}
    for convention in list_conventions():
        if convention.columns and convention.fits(headers, "", title):
            known |= convention.columns
    return [known.get(header, header) for header in headers]


def is_corrected(axes: Mapping[str, Column]) -> bool:
    """Whether the columns of a field are of those that a device writes after its own correction."""
    return any(_CORRECTED.search(column.header) for column in axes.values())


def _refuse_other_sensor(found: Identified, stem: str) -> None:
    """Raise `LogError` where bare axes stand in a file that is named for another sensor."""
    axes = found.get("field", {}).get("", {})
    if not axes or any(len(column.header) > 1 for column in axes.values()):
        return
    if re.search(_OTHERS, stem, re.IGNORECASE):
        raise LogError(
            f"its x, y and z are of no magnetometer, by the name of the file ({stem[:40]}); name "
            "the file of the magnetometer, or the folder of both"
        )
    other = find_named_quantity(stem)
    if other in ("acceleration", "rotation_rate"):
        name = BY_COLUMN[other].name
        raise LogError(
            f"its x, y and z are of the {name} that the file is named for, and no magnetometer; "
            "name the file of the magnetometer, or the folder of both"
        )


def find_named_quantity(name: str) -> str:
    """The vector quantity that a file, a table or a row is named for; "" where it is none."""
    words = re.split(r"[\W_]+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name))
    for text in (name, *words):
        column = identify_column(f"{text} x") if len(text) > 2 else None
        if column is not None and column.axis == "x" and column.rank != FALLBACK:
            return column.quantity.column
    return ""
