"""What a column of a table holds, told by its name: the canonical names and the aliases.

A canonical name is the quantity, the axis and the unit: `time_s`, `mag_x_nT`, `temperature_C`,
`acc_x_m_s2`. Loggers write other things, and `QUANTITIES` is the table of what is understood.
Case, blanks and punctuation do not count, so `Magnetometer X (uT)`, `magnetometer.x [µT]` and
`MagX_uT` are one name. The axis may stand before, within or after the name (`xmag`, `mag1_x`,
`magnetometer_ga[0]`), and so may the number of a sensor (`mag2_x`, `mag_x_2`, `imu2.mag.x`).
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

from agonic.errors import LogError, UnitError
from agonic.units import STANDARD_GRAVITY_M_S2, canonical

DEGREES_PER_RADIAN = math.degrees(1.0)

Linear = tuple[float, float]
"""Ours = factor × theirs + offset."""

_ANGLE: dict[str, Linear] = {"deg": (1, 0), "degrees": (1, 0), "rad": (DEGREES_PER_RADIAN, 0)}
_RATE: dict[str, Linear] = {
    spelling: (factor, 0)
    for factor, spellings in {
        1.0: ("rads", "radsec", "radpers"),
        1 / DEGREES_PER_RADIAN: ("degs", "degsec", "degpers", "dps"),
        1e-3 / DEGREES_PER_RADIAN: ("mdps",),
    }.items()
    for spelling in spellings
}
_ACCELERATION: dict[str, Linear] = {
    "ms2": (1, 0), "mss": (1, 0), "mpers2": (1, 0), "mps2": (1, 0),
    "g": (STANDARD_GRAVITY_M_S2, 0), "mg": (1e-3 * STANDARD_GRAVITY_M_S2, 0),
}  # fmt: skip
_TIME: dict[str, Linear] = {
    "s": (1, 0), "sec": (1, 0), "secs": (1, 0), "seconds": (1, 0), "min": (60, 0),
    "ms": (1e-3, 0), "msec": (1e-3, 0), "millis": (1e-3, 0), "milliseconds": (1e-3, 0),
    "us": (1e-6, 0), "usec": (1e-6, 0), "micros": (1e-6, 0), "microseconds": (1e-6, 0),
    "ns": (1e-9, 0), "nsec": (1e-9, 0), "nanoseconds": (1e-9, 0),
}  # fmt: skip
_TEMPERATURE: dict[str, Linear] = {
    "c": (1, 0), "degc": (1, 0), "celsius": (1, 0), "k": (1, -273.15),
    "f": (1 / 1.8, -32 / 1.8), "degf": (1 / 1.8, -32 / 1.8),
}  # fmt: skip
_POSITION: dict[str, Linear] = {**_ANGLE, "e7": (1e-7, 0), "dege7": (1e-7, 0)}
_HEIGHT: dict[str, Linear] = {"m": (1, 0), "mm": (1e-3, 0), "km": (1e3, 0), "ft": (0.3048, 0)}
_CURRENT: dict[str, Linear] = {"a": (1, 0), "ma": (1e-3, 0), "amps": (1, 0)}
_FIELD_UNITS = (
    "nt", "nanotesla", "gamma", "ut", "microtesla", "mt", "millitesla", "t", "tesla", "g", "gs",
    "gauss", "ga", "mg", "mgauss", "milligauss", "mga", "raw", "counts", "count", "lsb",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """What a column can hold: the `Samples` column, its canonical name, aliases and units.

    `weak` aliases are taken only where no other column is named for the quantity.
    """

    column: str
    name: str
    unit: str = ""
    aliases: str = ""
    weak: str = ""
    units: Mapping[str, Linear] = field(default_factory=dict)
    vector: bool = False


QUANTITIES: tuple[Quantity, ...] = (
    Quantity(
        column="time", name="time", unit="s", units=_TIME,
        aliases="t ts timestamp timestamps datetime utc utctime timeutc unixtime timeunix unix "
        "tunix timeboot timesinceboot timesincestart systemtime localtime",
        weak="elapsed elapsedtime timeelapsed secondselapsed trel relativetime uptime",
    ),
    Quantity(column="date", name="date", aliases="day utcdate"),
    Quantity(column="epoch", name="epoch_unix", unit="s", units={"s": (1, 0)}),
    Quantity(
        column="field", name="mag", vector=True,
        aliases="m b magn magneto magnetometer magnetic magneticfield magfield magneticflux "
        "magneticfluxdensity magneticinduction field bfield compass",
    ),
    Quantity(
        column="temperature", name="temperature", unit="C", units=_TEMPERATURE,
        aliases="temp magtemp magtemperature magnetometertemp magnetometertemperature",
    ),
    Quantity(column="roll_deg", name="roll", unit="deg", units=_ANGLE, aliases="rollangle"),
    Quantity(column="pitch_deg", name="pitch", unit="deg", units=_ANGLE, aliases="pitchangle"),
    Quantity(
        column="heading_deg", name="heading", unit="deg", units=_ANGLE,
        aliases="yaw yawangle trueheading headingtrue",
    ),
    Quantity(
        column="acceleration", name="acc", unit="m_s2", units=_ACCELERATION, vector=True,
        aliases="a accel accelerometer acceleration specificforce",
    ),
    Quantity(
        column="rotation_rate", name="gyro", unit="rad_s", units=_RATE, vector=True,
        aliases="g w gyr gyroscope angularvelocity angularrate rotationrate turnrate omega",
    ),
    Quantity(
        column="current_A", name="current", unit="A", units=_CURRENT,
        aliases="curr batterycurrent currentbattery motorcurrent",
    ),
    Quantity(
        column="throttle", name="throttle", aliases="thr", units={"percent": (0.01, 0)}
    ),
    Quantity(
        column="latitude_deg", name="latitude", unit="deg", units=_POSITION,
        aliases="lat gpslat gpslatitude locationlatitude",
    ),
    Quantity(
        column="longitude_deg", name="longitude", unit="deg", units=_POSITION,
        aliases="lon lng long gpslon gpslng gpslongitude locationlongitude",
    ),
    Quantity(
        column="altitude_m", name="altitude", unit="m", units=_HEIGHT,
        aliases="alt height elevation gpsalt gpsaltitude locationaltitude",
    ),
    Quantity(
        column="second", name="second", unit="nT", vector=True,
        units={"nt": (1, 0), "ut": (1e3, 0), "raw": (1, 0), "counts": (1, 0)},
        aliases="secondmag secondfield",
    ),
    Quantity(column="station", name="station", aliases="stationid pose orientation"),
    Quantity(
        column="scalar", name="scalar", unit="nT",
        units={"nt": (1, 0), "ut": (1e3, 0), "mt": (1e6, 0), "t": (1e9, 0), "g": (1e5, 0),
               "mg": (100, 0)},
        aliases="scalarfield scalarmag scalarmagnetometer fscalar",
    ),
    Quantity(
        column="flagged", name="flagged",
        aliases="excluded torquers torquerson mtq mtqon magnetorquers magnetorquerson",
    ),
    Quantity(column="sensor", name="sensor", aliases="sensorid sensorname magid"),
    Quantity(column="frame", name="frame"),
)  # fmt: skip

CANONICAL, ALIAS, FALLBACK = range(3)
BY_COLUMN = {quantity.column: quantity for quantity in QUANTITIES}


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


def _squashed(text: str) -> str:
    """Letters and digits only, signs spelled out: "m/s²" → "ms2", "µT" → "uT", "°/s" → "degs"."""
    plain = unicodedata.normalize("NFKC", text)
    for sign, spelling in (("μ", "u"), ("°", "deg"), ("%", "percent")):
        plain = plain.replace(sign, spelling)
    return re.sub(r"[^A-Za-z0-9]", "", plain)


_NAMES = {
    _squashed(name): (quantity, rank)
    for quantity in QUANTITIES
    for rank, names in (
        (ALIAS, f"{quantity.name} {quantity.aliases}"),
        (FALLBACK, quantity.weak),
    )
    for name in names.split()
}
_UNITS = {*_FIELD_UNITS, *(unit for q in QUANTITIES for unit in q.units)}


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
    rf"(?P<axis>[xyz])(?:axis)?(?P<after>\d*)(?P<unit>{_either(_FIELD_UNITS)})?", re.IGNORECASE
)
_BRACKET = re.compile(r"(?P<name>[^(\[{]*[^\s(\[{])\s*[(\[{](?P<unit>[^)\]}]*)[)\]}]\s*")
_INDEX = re.compile(r"\[([012])\]\s*$")
_LONGEST = 120

MOST_COLUMNS = 4096
"""A table of more columns is not a log."""


def understood(header: str) -> Column | None:
    """What a header says, or `None` where it is not one of the names above.

    >>> column = understood("Magnetometer X (uT)")
    >>> column.quantity.column, column.axis, column.unit
    ('field', 'x', 'uT')
    """
    if len(header) > _LONGEST or header.strip() == "T":  # "T" is as often temperature as time
        return None
    text = _INDEX.sub(lambda index: "xyz"[int(index[1])], header.strip())
    bracket = _BRACKET.fullmatch(text)
    name = _squashed(bracket["name"] if bracket else text)
    if len(name) > 3 and name.lower() in _TIME:  # a column called "millis"
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
    known, unit = _unit(quantity, match["unit"], _squashed(bracket["unit"]) if bracket else "")
    if not known:
        return None
    axis = axes[0].lower() if axes else ""
    if header == canonical_header(quantity.column, axis, unit):
        rank = CANONICAL
    return Column(header=header, quantity=quantity, axis=axis, sensor=sensor, unit=unit, rank=rank)


def canonical_header(column: str, axis: str = "", unit: str | None = None) -> str:
    """The name that `write_csv` gives to a column; the field's carries the unit of the samples.

    >>> canonical_header("field", "x", "nT"), canonical_header("acceleration", "z")
    ('mag_x_nT', 'acc_z_m_s2')
    """
    quantity = BY_COLUMN[column]
    written = unit or "" if column in ("field", "second") else quantity.unit
    return "_".join(part for part in (quantity.name, axis, written) if part)


def _unit(quantity: Quantity, suffix: str | None, bracket: str) -> tuple[bool, str | None]:
    """Whether the unit is one of the quantity's, and which; a bracket may hold a remark."""
    written = suffix or bracket
    if not written:
        return True, None
    if quantity.column == "field":
        with suppress(UnitError):
            return True, canonical(written)
    elif written.lower() in quantity.units:
        return True, written.lower()
    return quantity.column in ("field", "time") and not suffix, None


def positions(headers: Sequence[str]) -> dict[int, str]:
    """The columns that are understood, by position; none may be there twice.

    >>> positions(["no", "mag_x", "mag_y"])
    {1: 'mag_x', 2: 'mag_y'}
    """
    if len(headers) > MOST_COLUMNS:
        raise LogError(f"{len(headers)} columns: more than {MOST_COLUMNS} are no log")
    found = {i: header for i, header in enumerate(headers) if understood(header) is not None}
    for header, times in Counter(found.values()).items():
        if times > 1:
            raise LogError(f"the column {header!r} is there {times} times; rename or remove one")
    return found


Identified = dict[str, dict[str, dict[str, Column]]]
"""Columns by quantity, number of the sensor and axis; "" where there is no number or axis."""


def identified(headers: Iterable[str]) -> Identified:
    """The columns that are understood, the best name for each.

    Raises `LogError` naming both where two columns could be the same thing.

    >>> identified(["t", "mag2_x", "note"])["field"]["2"]["x"].header
    'mag2_x'
    """
    groups: dict[tuple[str, str], list[Column]] = {}
    for column in map(understood, headers):
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
