"""Lines of text as readings: MotionCal, tables with a header or without, NMEA-like sentences."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from agonic.errors import AgonicError
from agonic.logs.contents import to_number
from agonic.logs.headers.columns import Identified, identify_column, identify_columns
from agonic.units import RAW, STANDARD_GRAVITY_M_S2

Vector = tuple[float, float, float]


class Reading(NamedTuple):
    """One reading: the sensor's name, the field, its unit, and the device's own time, s. `motion`
    is what came with it of an inertial unit: acceleration, m/s², and rotation rate, rad/s, NaN
    where not known."""

    sensor: str
    field: Vector
    unit: str
    time: float | None = None
    motion: tuple[float, ...] | None = None


class Unreadable(AgonicError):
    """A line that holds no reading, with the reason."""


_SEPARATORS = re.compile(r"[,;\t ]\s*")
_SENTENCES = {"VNIMU": "G"}
"""Sentences whose first three values are an uncorrected field, and their unit (VectorNav);
acceleration, m/s², and rotation rate, rad/s, follow."""
_CORRECTED = ("VNMAG", "VNYMR", "VNYIA", "VNYBA")
"""Sentences of the same maker whose field the device has already corrected."""
_MOTIONCAL_OTHERS = ("Uni:", "Ori:")


@dataclass
class LineParser:
    """What is known of the lines so far: the header, once there was one. `unit` is that of numbers
    without a header; `told` holds the device's answers `Cal1:` and `Cal2:`, by name."""

    unit: str = RAW
    header: dict[str, list[tuple[int, float]]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    inertial: dict[str, list[tuple[int, float]]] = field(default_factory=dict)
    time: tuple[int, float] | None = None
    width: int = 0
    told: dict[str, tuple[float, ...]] = field(default_factory=dict)
    motioncal: bool = False

    def read(self, line: str) -> list[Reading]:
        """The readings in a line, none where it is a header, a remark or empty."""
        text = line.strip()
        if not text or text[0] in "#%" or text.startswith(_MOTIONCAL_OTHERS):
            return []
        if text.startswith("Raw:"):
            self.motioncal = True
            counts = _parse_numbers(text[4:], 9)
            return [Reading("mag", _make_vector(counts[6:]), "mG", None, _scale_counts(counts[:6]))]
        if text.startswith(("Cal1:", "Cal2:")):
            self.told[text[:4]] = _parse_numbers(text[5:], None)
            return []
        if text[0] in "$!":
            return [_parse_sentence(text)]
        return self._cells([cell.strip() for cell in _SEPARATORS.split(text) if cell.strip()])

    def _cells(self, cells: list[str]) -> list[Reading]:
        values = [to_number(cell) for cell in cells]
        words = sum(
            math.isnan(v) and c.lower() != "nan" for c, v in zip(cells, values, strict=True)
        )
        if 2 * words > len(cells):
            self._begin(cells)
            return []
        if not self.header:
            if len(values) != 3:
                raise Unreadable(
                    f"{len(values)} numbers without a header: send three (x, y, z), or a header"
                )
            return [Reading("mag", _make_vector(values), self.unit)]
        if len(values) != self.width:
            raise Unreadable(f"{len(values)} cells under a header of {self.width}")
        time = None if self.time is None else values[self.time[0]] * self.time[1]
        return [
            Reading(
                name,
                _make_vector([values[i] * by for i, by in columns]),
                self.units[name],
                time,
                tuple(values[i] * by for i, by in self.inertial.get(name, ())) or None,
            )
            for name, columns in self.header.items()
        ]

    def _begin(self, cells: list[str]) -> None:
        """Take a line as header."""
        if any("\ufffd" in cell or not cell.isprintable() for cell in cells):
            raise Unreadable("not a text")
        told = identify_columns(cells)
        found = told.get("field", {})
        whole = {number: axes for number, axes in found.items() if len(axes) == 3}
        if not whole:
            raise Unreadable("a header without a field: name the columns mag_x_uT, mag_y_uT, …")
        place = {cell: i for i, cell in enumerate(cells)}
        self.header = {
            f"mag{number}": [(place[axes[a].header], 1.0) for a in "xyz"]
            for number, axes in whole.items()
        }
        for number, axes in whole.items():
            units = {column.unit for column in axes.values()}
            self.units[f"mag{number}"] = (units.pop() if len(units) == 1 else None) or self.unit
        self.inertial = {f"mag{number}": _find_motion(told, number, place) for number in whole}
        self.width, self.time = len(cells), _find_clock(cells)


def _find_motion(
    told: Identified, number: str, place: Mapping[str, int]
) -> list[tuple[int, float]]:
    """The columns of acceleration and rotation rate beside a magnetometer, with factors to m/s²
    and rad/s; none without an acceleration, and rates times NaN without a gyro."""
    groups: list[list[tuple[int, float]]] = []
    for name in ("acceleration", "rotation_rate"):
        of = told.get(name, {})
        axes = of.get(number) or of.get("") or {}
        factors = [axes[a].quantity.units.get(axes[a].unit or "") for a in "xyz" if a in axes]
        known = [factor[0] for factor in factors if factor is not None]
        raw = any(axes[a].unit in ("raw", "counts") for a in axes)
        if len(known) == 3 and not raw:
            groups.append([(place[axes[a].header], by) for a, by in zip("xyz", known, strict=True)])
        else:
            groups.append([(0, math.nan)] * 3)
    return [] if math.isnan(groups[0][0][1]) else groups[0] + groups[1]


def _scale_counts(counts: tuple[float, ...]) -> tuple[float, ...] | None:
    """Acceleration and rotation rate of MotionCal's counts; `None` of zeros, which stand for
    none."""
    if not any(counts[:3]):
        return None
    force = tuple(STANDARD_GRAVITY_M_S2 / 8192 * v for v in counts[:3])  # MotionCal, rawdata.c
    return force + tuple(math.radians(1 / 16) * v for v in counts[3:])


def _find_clock(cells: list[str]) -> tuple[int, float] | None:
    """The column of the device's clock, and its unit in seconds."""
    for i, cell in enumerate(cells):
        column = identify_column(cell)
        if column is not None and column.quantity.column == "time":
            by = column.quantity.units.get((column.unit or "s").lower(), (None, 0))[0]
            return None if by is None else (i, float(by))
    return None


def _parse_sentence(text: str) -> Reading:
    """The reading in `$NAME,x,y,z,…*HH`; the checksum is the XOR of what lies between."""
    body, star, check = text[1:].partition("*")
    if star:
        total = 0
        for byte in body.encode("latin-1", "replace"):
            total ^= byte
        if check.strip()[:2].upper() != f"{total:02X}":
            raise Unreadable("a sentence whose checksum is wrong")
    name, *cells = body.split(",")
    if name in _CORRECTED:
        raise Unreadable(f"${name} is already corrected by the device: have it send $VNIMU")
    if name not in _SENTENCES and not name.endswith("MAG"):
        raise Unreadable(f"${name} holds no field that is known: send $…MAG,x,y,z")
    values = [to_number(cell) for cell in cells[:9]]
    if len(values) < 3 or any(map(math.isnan, values[:3])):
        raise Unreadable(f"${name} without three numbers")
    motion = tuple(values[3:9]) if name in _SENTENCES and len(values) == 9 else None
    return Reading("mag", _make_vector(values), _SENTENCES.get(name, ""), None, motion)


def _make_vector(values: list[float] | tuple[float, ...]) -> Vector:
    x, y, z = values[:3]
    return x, y, z


def _parse_numbers(text: str, count: int | None) -> tuple[float, ...]:
    """The numbers between commas; exactly so many, where it is known."""
    values = tuple(to_number(cell) for cell in text.split(","))
    if (count is not None and len(values) != count) or any(map(math.isnan, values)):
        raise Unreadable(f"a line that should hold {count or 'only'} numbers")
    return values
