"""What a column of a table holds, told by its name: the canonical names and the aliases.

A canonical name is the quantity, the axis and the unit: `time_s`, `mag_x_nT`, `temperature_C`,
`acc_x_m_s2`. Loggers write other things, and `QUANTITIES` is the table of what is understood.
Case, blanks and punctuation do not count, so `Magnetometer X (uT)`, `magnetometer.x [µT]` and
`MagX_uT` are one name. The axis may stand before, within or after the name (`xmag`, `mag1_x`,
`magnetometer_ga[0]`), and so may the number of a sensor (`mag2_x`, `mag_x_2`, `imu2.mag.x`).
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache

from agonic.errors import LogError, UnitError
from agonic.logs.quantities import (
    BY_COLUMN,
    FIELD_UNITS,
    QUANTITIES,
    TIMES,
    Quantity,
    canonical_header,
)
from agonic.units import find_unit

CANONICAL, ALIAS, FALLBACK = range(3)


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column that was understood: `header` as written, its quantity, axis, sensor and unit.

    `unit` is `None` where the header does not say; for the field it is one of `agonic.units`.
    `rank` is `CANONICAL`, `ALIAS` or `FALLBACK`; the lowest is taken.
    """

    header: str
    quantity: Quantity
    axis: str = ""
    sensor: str = ""
    unit: str | None = None
    rank: int


def _squash(text: str) -> str:
    """Letters and digits only, signs spelled out: "m/s²" → "ms2", "µT" → "uT", "°/s" → "degs"."""
    plain = unicodedata.normalize("NFKC", text)
    for sign, spelling in (("μ", "u"), ("°", "deg"), ("%", "percent")):
        plain = plain.replace(sign, spelling)
    return re.sub(r"[^A-Za-z0-9]", "", plain)


_NAMES = {
    _squash(name): (quantity, rank)
    for quantity in QUANTITIES
    for rank, names in (
        (ALIAS, f"{quantity.name} {quantity.aliases}"),
        (FALLBACK, quantity.weak),
    )
    for name in names.split()
}
_UNITS = {*FIELD_UNITS, *(unit for q in QUANTITIES for unit in q.units)}


def _either(words: Iterable[str]) -> str:
    return "|".join(sorted(words, key=len, reverse=True))


_NAME = _either(_NAMES).replace("|magn|", "|magn(?!t[xyz]?$)|")
"""magnT is mag in nT, as mag_nT[0], not magn in T."""
_PATTERN = re.compile(
    r"(?:raw|imu(?P<imu>\d*)|sensor|field|data|msg|message)*?"
    rf"(?P<before>[xyz])?(?P<name>{_NAME})(?:raw)?(?P<number>\d*)(?P<axis>[xyz])?(?:axis)?"
    rf"(?P<after>\d*)(?:in)?(?P<unit>{_either(_UNITS)})?(?P<last>[xyz])?",
    re.IGNORECASE,
)
_BARE = re.compile(
    rf"(?P<axis>[xyz])(?:axis)?(?P<after>\d*)(?P<unit>{_either(FIELD_UNITS)})?", re.IGNORECASE
)
_BRACKET = re.compile(r"(?P<name>[^(\[{]*[^\s(\[{])\s*[(\[{](?P<unit>[^)\]}]*)[)\]}]\s*")
_INDEX = re.compile(r"\[([012])\]\s*$")
_LONGEST = 120

MOST_COLUMNS = 4096
"""A table of more columns is not a log."""


def refuse_many(count: int, what: str = "") -> None:
    """Raise `LogError` for a table of more than `MOST_COLUMNS`, or so many arrays or variables."""
    if count > MOST_COLUMNS:
        many = f"it holds more than {MOST_COLUMNS} {what}: this is no log"
        raise LogError(many if what else f"{count} columns: more than {MOST_COLUMNS} are no log")


@lru_cache(maxsize=MOST_COLUMNS)
def identify_column(header: str) -> Column | None:
    """What a header says, or `None` where it is not one of the names above.

    >>> column = identify_column("Magnetometer X (uT)")
    >>> column.quantity.column, column.axis, column.unit
    ('field', 'x', 'uT')
    """
    if len(header) > _LONGEST or header.strip() == "T":  # "T" is as often temperature as time
        return None
    text = _INDEX.sub(lambda index: "xyz"[int(index[1])], header.strip())
    bracket = _BRACKET.fullmatch(text)
    name = _squash(bracket["name"] if bracket else text)
    if len(name) > 3 and name.lower() in TIMES:  # a column called "millis"
        name = f"time{name}"
    if match := _PATTERN.fullmatch(name):
        quantity, rank = _NAMES[match["name"].lower()]
        axes = [match[group] for group in ("before", "axis", "last") if match[group]]
        sensor = match["after"] or match["number"] or match["imu"] or ""
    elif match := _BARE.fullmatch(name):
        quantity, rank = BY_COLUMN["field"], FALLBACK
        axes, sensor = [match["axis"]], match["after"]
    else:
        return None
    if len(axes) != bool(quantity.vector):
        return None
    known, unit = _unit(quantity, match["unit"], _squash(bracket["unit"]) if bracket else "")
    if not known:
        return None
    axis = axes[0].lower() if axes else ""
    if header == canonical_header(quantity.column, axis, unit):
        rank = CANONICAL
    return Column(header=header, quantity=quantity, axis=axis, sensor=sensor, unit=unit, rank=rank)


def _unit(quantity: Quantity, suffix: str | None, bracket: str) -> tuple[bool, str | None]:
    """Whether the unit is one of the quantity's, and which; a bracket may hold a remark."""
    written = suffix or bracket
    if not written:
        return True, None
    if quantity.column == "field":
        with suppress(UnitError):
            return True, find_unit(written)
    elif written.lower() in quantity.units:
        return True, written.lower()
    return quantity.column in ("field", "time") and not suffix, None


def find_columns(headers: Sequence[str]) -> dict[int, str]:
    """The columns that are understood, by position; none may be there twice.

    >>> find_columns(["no", "mag_x", "mag_y"])
    {1: 'mag_x', 2: 'mag_y'}
    """
    refuse_many(len(headers))
    found = {i: header for i, header in enumerate(headers) if identify_column(header) is not None}
    for header, times in Counter(found.values()).items():
        if times > 1:
            raise LogError(f"the column {header!r} is there {times} times; rename or remove one")
    return found


Identified = dict[str, dict[str, dict[str, Column]]]
"""Columns by quantity, number of the sensor and axis; "" where there is no number or axis."""


def identify_columns(headers: Iterable[str]) -> Identified:
    """The columns that are understood, the best name for each.

    Raises `LogError` naming both where two columns could be the same thing.

    >>> identify_columns(["t", "mag2_x", "note"])["field"]["2"]["x"].header
    'mag2_x'
    """
    groups: dict[tuple[str, str], list[Column]] = {}
    for column in map(identify_column, headers):
        if column is not None:
            groups.setdefault((column.quantity.column, column.sensor), []).append(column)
    found: Identified = {}
    for (name, sensor), columns in groups.items():
        best = min(column.rank for column in columns)
        axes: dict[str, Column] = {}
        for column in (column for column in columns if column.rank == best):
            twin = axes.setdefault(column.axis, column)
            if twin is not column:
                raise LogError(
                    f"{twin.header!r} and {column.header!r} could both be the "
                    f"{' '.join(filter(None, (column.quantity.name, sensor, column.axis)))} "
                    "column; rename or remove one of them"
                )
        found.setdefault(name, {})[sensor] = axes
    return found
