"""What one header says: the quantity, the axis, the sensor and the unit that its words name."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache

from agonic.errors import UnitError
from agonic.logs.headers.quantities import (
    BY_COLUMN,
    DISTURBER,
    DISTURBER_UNITS,
    FIELD_UNITS,
    QUANTITIES,
    TIMES,
    Quantity,
    canonical_header,
)
from agonic.logs.headers.words import ZONE, spell_out
from agonic.units import find_unit

PREFERRED, CANONICAL, ALIAS, FALLBACK, LAST = range(5)


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column that was understood: `header` as written, its quantity, axis, sensor and unit.

    `unit` is `None` where the header does not say; for the field it is one of `agonic.units`.
    `rank` is `PREFERRED`, `CANONICAL`, `ALIAS`, `FALLBACK` or `LAST`; the lowest is taken.
    `documented` is the format whose documents give the unit, where the header itself does not.
    """

    header: str
    quantity: Quantity
    axis: str = ""
    sensor: str = ""
    unit: str | None = None
    rank: int
    documented: str = ""


def _squash(text: str) -> str:
    """Letters and digits only: "m/s2" → "ms2". A letter that is not known spoils the name."""
    return re.sub(r"[\W_]", "", text)


_NAMES: dict[str, list[tuple[Quantity, int]]] = {}
for _quantity in QUANTITIES:
    for _rank, _names in (
        (ALIAS, f"{_quantity.name} {_quantity.aliases}"),
        (FALLBACK, _quantity.weak),
        (LAST, _quantity.last),
        (PREFERRED, _quantity.preferred),
    ):
        for _name in _names.split():
            _NAMES.setdefault(_squash(_name), []).append((_quantity, _rank))
_UNITS = {*FIELD_UNITS, *(unit for q in QUANTITIES for unit in q.units)}


def _either(words: Iterable[str]) -> str:
    return "|".join(sorted(words, key=len, reverse=True))


_NAME = _either(_NAMES).replace("|magn|", "|magn(?!t[xyz]?$)|")
"""magnT is mag in nT, as mag_nT[0], not magn in T."""
_BEFORE = "raw|imu|sensor|sensors|field|data|msg|message|header|vehicle|uncal|uncomp|cell"
_WITHIN = "vector|raw|adc|smooth|uncal|uncomp|buffer|data|values|readings"
_PATTERN = re.compile(
    rf"(?:imu(?P<imu>\d+)|{_BEFORE})*?"
    rf"(?P<before>[xyz])?(?P<name>{_NAME})(?:{_WITHIN})*(?P<number>\d*)(?P<axis>[xyz])?(?:axis)?"
    rf"(?P<after>\d*)(?:uncal|uncomp)?(?:in(?!t[xyz]?$))?(?P<unit>{_either(_UNITS)})?(?P<last>[xyz])?",
    re.IGNORECASE,
)
_SCALAR_PART = re.compile(
    rf"(?:{_BEFORE}|imu\d*)*?(?P<name>q|quat|quaternion|orientation|attitude|rotation)w",
    re.IGNORECASE,
)
_BARE = re.compile(
    rf"(?:raw)?(?P<axis>[xyz])(?:axis|value)?(?P<after>\d*)(?P<unit>{_either(FIELD_UNITS)})?",
    re.IGNORECASE,
)
_TIME_OR_TEMPERATURE = re.compile(r"T|[tT]\d+")
_TEMPERATURE = re.compile(r"t(?P<after>\d*)(?P<unit>c|degc|celsius|k|degf|f|deg)", re.IGNORECASE)
"""A letter that stands for time, temperature and tesla: the unit says which."""
_SCALED = re.compile(
    r"(?<![A-Za-z])(?:\d+\.\d+|(?<!\d)1(?:0{1,6}|[eE][-+]?\d+))\s?"
    r"(?=(?:[nuµμm]?T|m?G|m?A|C|g)[)\]}\s]*$)"
)
"""A factor before a unit, 0.1uT: the numbers are in no unit that is known."""
_BRACKET = re.compile(r"(?P<name>[^(\[{]*[^\s(\[{])\s*[(\[{](?P<unit>[^)\]}]*)[)\]}]\s*")
_LAST_BRACKET = re.compile(
    r"(?P<name>.*[)\]}].*[^\s(\[{])\s*[(\[{](?P<unit>[^()\[\]{}]{2,})[)\]}]\s*"
)
"""A unit behind a name that has brackets of its own: IMU_ATTI(0):magX[a/d]."""
_IN = re.compile(r"^\s*(?:in|units?)\b[\s:=]*(?=\w)", re.IGNORECASE)
"""What may stand before a unit in words: x (in microteslas)."""
_COMMA = re.compile(r"(?P<name>[^,;]*\w)\s*[,;]\s*(?P<unit>[^,;]+)")
_OVER = re.compile(r"(?P<name>.*\w)\s+/\s+(?P<unit>\S+)\s*")
_INDEX = re.compile(r"(?<!q)(?<!quat)\[([012])\]|(?<!q)(?<!quat)\.0([012])\s*$", re.IGNORECASE)
_ORDERED = re.compile(r"_?(wxyz|xyzw)_?\[?([0-3])\]?\s*$", re.IGNORECASE)
"""A component of a quaternion whose name states the order."""
_UNCORRECTED = re.compile(r"un_?(cal|comp)(ibrated|ensated)?", re.IGNORECASE)
_SHIMMER = re.compile(r"Shimmer_\w{4}_(\w+?)(?:_LN)?((?:_[XYZ])?)_(?:CAL|RAW|UNCAL)(?=$|\s*\()")
"""What the makers of Shimmer write around a name; of two accelerometers the one of low noise."""
_EPOCH = re.compile(r"epoch(?=\s*[(\[_]\s*(?:ms|us|ns|s)[)\]]?$)", re.IGNORECASE)
"""Unix time with its unit, before local times beside it, whose zones are often wrong (MetaWear)."""
_OF_GPS = {"timegpsweek": "gps_week", "timegpstow": "gps_tow"}
_TOKEN = re.compile(r"[A-Z]?[a-z][a-z0-9]*|[A-Z][A-Z0-9]*(?![a-z])|\d+|[^\W_]+")
_NO_READING = frozenset(
    """
    bias offset std stdev sigma cov covariance var variance err error residual fit fitted cal calib
    calibrated corrected comp compensated norm total mean avg average median delta diff ref
    reference expected model igrf wmm truth true target desired setpoint sp accuracy drift noise
    scale gain max min abs eci ecef ned nec enu lvlh hard soft moment dipole torque pos position vel
    velocity speed mtq earth d
    """.split()  # noqa: SIM905
)
"""Words before a name that say that the column is not what a sensor reads."""
_IDLE = frozenset(_BEFORE.split("|")) | {"topic", "stamped", "buffer", "values", "log"}
_TESLA = ("nT", "uT", "mT", "T", "G", "mG")
_GRAVITIES = ("g", "mg")
_AMBIGUOUS = ("t", "g", "mg", "ga", "mt")
_DISTURBER = re.compile(rf"(?P<name>[^\W\d]\w*)_(?P<unit>{_either(DISTURBER.units)})", re.ASCII)
"""The name of something that draws power or is magnetic, its unit behind it: heater_mA."""
_LONGEST = 120

MOST_COLUMNS = 4096
"""A table of more columns is not a log."""


@lru_cache(maxsize=MOST_COLUMNS)
def identify_column(header: str, sensors: frozenset[str] = frozenset()) -> Column | None:
    """What a header says, or `None` where it is not one of the names above.

    `sensors` are names of sensors before which a scalar may stand: `mmc_T_C` beside `mmc_x_uT`.

    >>> column = identify_column("Magnetometer X (uT)")
    >>> column.quantity.column, column.axis, column.unit
    ('field', 'x', 'uT')
    >>> column = identify_column("mmc_x_uT")
    >>> column.quantity.column, column.sensor
    ('field', 'mmc')
    """
    if len(header) > _LONGEST or _TIME_OR_TEMPERATURE.fullmatch(header.strip()):
        return None
    if scaled := _SCALED.search(header):
        column = identify_column(header[: scaled.start()].rstrip("_ ([{"), sensors)
        known = column is not None and column.quantity.column == "field" and column.unit is None
        return replace(column, header=header) if column is not None and known else None
    plain = ZONE.sub("", header.strip()) or header
    text = _UNCORRECTED.sub(r"un\1", spell_out(_EPOCH.sub("epoc", _SHIMMER.sub(r"\1\2", plain))))
    text = _INDEX.sub(lambda index: "_" + "xyz"[int(index[1] or index[2])], text)
    text = _ORDERED.sub(lambda index: f"_{index[1][int(index[2])]}", text)
    split = (
        _BRACKET.fullmatch(text)
        or _LAST_BRACKET.fullmatch(text)
        or _COMMA.fullmatch(text)
        or _OVER.fullmatch(text)
    )
    name, unit = (split["name"], _squash(_IN.sub("", split["unit"]))) if split else (text, "")
    unit = f"{unit}s" if unit.lower().endswith("second") and f"{unit}s".lower() in _UNITS else unit
    if unit and not unit.isascii():
        return None
    if split and (named := _OF_GPS.get(_squash(text).lower())):  # Time (GPS TOW)
        return Column(header=header, quantity=BY_COLUMN[named], rank=ALIAS)
    found = _identify(header, _squash(name), unit)
    found = found or _identify_with_sensor(header, name, unit, sensors)
    return found or _identify_disturber(header.strip())


def _identify_disturber(header: str) -> Column | None:
    """What a canonical name with the unit of a current, a power, a dipole or a duty says."""
    match = _DISTURBER.fullmatch(header)
    if match is None:
        return None
    unit = match["unit"]
    return Column(
        header=header,
        quantity=DISTURBER,
        sensor=f"{match['name']}_{DISTURBER_UNITS.get(unit, unit)}",
        unit=unit,
        rank=CANONICAL if unit not in DISTURBER_UNITS else ALIAS,
    )


def _identify(header: str, name: str, bracket: str, sensor: str = "") -> Column | None:
    """What a name without punctuation says, with the unit beside it."""
    if len(name) > 3 and name.lower() in TIMES:  # a column called "millis"
        name = f"time{name}"
    if match := _TEMPERATURE.fullmatch(name + bracket):
        choices, axes, number = [(BY_COLUMN["temperature"], ALIAS)], [], match["after"]
        suffix = match["unit"]
    elif match := _SCALAR_PART.fullmatch(name):
        choices, axes, number, suffix = [(BY_COLUMN["quaternion"], ALIAS)], ["w"], "", None
    elif match := _PATTERN.fullmatch(name):
        choices = _NAMES[match["name"].lower()]
        axes = [match[group] for group in ("before", "axis", "last") if match[group]]
        number, suffix = match["after"] or match["number"] or match["imu"] or "", match["unit"]
    elif match := _BARE.fullmatch(name):
        choices = [(BY_COLUMN["field"], FALLBACK)]
        axes, number, suffix = [match["axis"]], match["after"], match["unit"]
    else:
        return None
    axis = "".join(axes).lower()
    for quantity, rank in choices:
        if rank == FALLBACK and quantity.column == "field" and not _may_be_bare(suffix or bracket):
            continue
        if rank == LAST and _squash(header).lower() not in quantity.last.split():
            continue
        if axis not in quantity.axes.split() and (axis or quantity.axes):
            continue
        known, unit = _unit(quantity, suffix, bracket)
        if not known:
            continue
        whole = f"{sensor}{number}"
        if header == canonical_header(quantity.column, axis, unit):
            rank = CANONICAL
        if quantity.column == "field" and re.search("uncal|uncomp", name, re.IGNORECASE):
            rank = PREFERRED
        return Column(
            header=header, quantity=quantity, axis=axis, sensor=whole, unit=unit, rank=rank
        )
    return None


def _may_be_bare(unit: str) -> bool:
    """Whether x, y or z alone with this unit, if any, can be a field: no "g", no unit of others."""
    with suppress(UnitError):
        return not unit or (find_unit(unit) != "" and unit not in _GRAVITIES)
    return False


def _identify_with_sensor(
    header: str, name: str, unit: str, sensors: frozenset[str]
) -> Column | None:
    """What a name says behind the words that name a sensor."""
    tokens = _TOKEN.findall(name)
    if len(tokens) > 1 and tokens[-1].lower() in ("imu", "gps", "gnss"):
        return _of_a_clock(header, tokens, unit)
    for at in range(1, len(tokens)):
        before, rest = tokens[:at], "".join(tokens[at:])
        if _TIME_OR_TEMPERATURE.fullmatch(rest):
            return None
        if _NO_READING.intersection(word.lower() for word in before):
            return None
        column = _identify(header, rest, unit)
        if column is None:
            continue
        sensor = _name_sensor(before, column.quantity)
        bare = column.rank == FALLBACK and column.quantity.column in ("field", "time")
        if sensor is None or (bare and not _is_field_unit(column, rest, unit)):
            return None
        if (
            not column.axis
            and column.quantity.column != "time"
            and sensor
            and sensor not in sensors
            and "/" not in header
        ):
            return None
        rank = ALIAS if column.quantity.column == "field" else column.rank
        if re.search("uncal|uncomp", "".join(before), re.IGNORECASE):
            rank = PREFERRED
        return Column(
            header=header,
            quantity=column.quantity,
            axis=column.axis,
            sensor=f"{sensor}{column.sensor}",
            unit=column.unit,
            rank=rank,
        )
    return None


def is_unit(text: str) -> bool:
    """Whether a word is a unit of anything that a column can hold.

    >>> is_unit("uTesla"), is_unit("m/s^2"), is_unit("Heading")
    (True, True, False)
    """
    return _squash(spell_out(text)).lower() in _UNITS


def names_reading(name: str) -> bool:
    """Whether no word of a name says that it stands for something that no sensor reads.

    >>> names_reading("data"), names_reading("hard_iron_bias")
    (True, False)
    """
    return not _NO_READING.intersection(word.lower() for word in _TOKEN.findall(name))


def _of_a_clock(header: str, tokens: list[str], unit: str) -> Column | None:
    """A time whose last word says whose it is: `timestamp_sec_imu`."""
    column = _identify(header, "".join(tokens[:-1]), unit)
    if column is None or column.quantity.column != "time":
        return None
    sensor = "" if tokens[-1].lower() == "imu" else tokens[-1].lower()
    return Column(
        header=header, quantity=column.quantity, sensor=sensor, unit=column.unit, rank=column.rank
    )


def _name_sensor(words: Sequence[str], quantity: Quantity) -> str | None:
    """The sensor that words before a name stand for; `None` where they name another quantity."""
    kept = []
    for word in words:
        if word.lower() in _IDLE:
            continue
        if not word.isascii():
            return None
        own = _identify(word, f"{word}x", "") or _identify(word, word, "")
        if own is None or own.rank == FALLBACK:
            kept.append(word)
        elif own.quantity.column == quantity.column or _belongs(own.quantity, quantity):
            kept += [own.sensor] if own.sensor else []
        elif own.quantity.axes and quantity.column == "time":
            kept.append(word)  # acc_time
        elif not quantity.axes or own.quantity.axes:
            return None  # mag_heading
        else:
            kept.append(word)
    return "_".join(kept)


def _belongs(own: Quantity, quantity: Quantity) -> bool:
    """Whether a column named for one quantity may tell another of the magnetometer: mag1_temp."""
    return own.column == "field" and quantity.column in ("time", "temperature", "unit")


def _is_field_unit(column: Column, rest: str, bracket: str) -> bool:
    """Whether the unit alone says that the column is a field: no other quantity has it."""
    written = (bracket or re.sub(r"^[xyz](axis)?\d*", "", rest, flags=re.IGNORECASE)).lower()
    return column.unit in _TESLA and written not in _AMBIGUOUS


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
