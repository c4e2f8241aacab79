"""What one header says: the quantity, the axis, the sensor and the unit that its words name."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache

from agonic.errors import UnitError
from agonic.logs.headers import quantities as spelled
from agonic.units import find_unit


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column that was understood: `header` as written, its quantity, axis, sensor and unit.
    `unit` is `None` where the header does not say; for the field it is one of `agonic.units`.
    `rank` is `PREFERRED`, `CANONICAL`, `ALIAS`, `FALLBACK` or `LAST`; the lowest is taken.
    `documented` is the format whose documents give the unit, where the header itself does not."""

    header: str
    quantity: spelled.Quantity
    axis: str = ""
    sensor: str = ""
    unit: str | None = None
    rank: int
    documented: str = ""


LONGEST = 120
"""Letters of a header; a longer one is none."""
MOST_COLUMNS = 4096
"""A table of more columns is not a log."""


@lru_cache(maxsize=MOST_COLUMNS)
def identify_column(header: str, sensors: frozenset[str] = frozenset()) -> Column | None:
    """What a header says, or `None` where it is no known name. `sensors` are names of sensors
    before which a scalar may stand: `mmc_T_C` beside `mmc_x_uT`."""
    if len(header) > LONGEST or spelled.TIME_OR_TEMPERATURE.fullmatch(header.strip()):
        return None
    if scaled := spelled.SCALED.search(header):
        column = identify_column(header[: scaled.start()].rstrip("_ ([{"), sensors)
        known = column is not None and column.quantity.column == "field" and column.unit is None
        return replace(column, header=header) if column is not None and known else None
    plain = spelled.ZONE.sub("", header.strip()) or header
    text = spelled.UNCORRECTED.sub(
        r"un\1", spelled.spell_out(spelled.EPOCH.sub("epoc", spelled.SHIMMER.sub(r"\1\2", plain)))
    )
    text = spelled.INDEX.sub(lambda index: "_" + "xyz"[int(index[1] or index[2])], text)
    text = spelled.ORDERED.sub(lambda index: f"_{index[1][int(index[2])]}", text)
    split = next(filter(None, (form.fullmatch(text) for form in spelled.WITH_UNIT)), None)
    name, unit = (
        (split["name"], spelled.squash(spelled.IN.sub("", spelled.CODE.sub("", split["unit"]))))
        if split
        else (text, "")
    )
    unit += "s" * (unit.lower().endswith("second") and f"{unit}s".lower() in spelled.UNITS)
    if unit and not unit.isascii():
        return None
    if split and (named := spelled.OF_GPS.get(spelled.squash(text).lower())):  # Time (GPS TOW)
        return Column(header=header, quantity=spelled.BY_COLUMN[named], rank=spelled.ALIAS)
    return (
        _identify(header, spelled.squash(name), unit)
        or _identify_with_sensor(header, name, unit, sensors)
        or _identify_disturber(header.strip())
    )


def _identify_disturber(header: str) -> Column | None:
    """What a canonical name with the unit of a current, a power, a dipole or a duty says."""
    match = spelled.DISTURBER_NAME.fullmatch(header)
    if match is None:
        return None
    unit = match["unit"]
    return Column(
        header=header,
        quantity=spelled.DISTURBER,
        sensor=f"{match['name']}_{spelled.DISTURBER_UNITS.get(unit, unit)}",
        unit=unit,
        rank=spelled.CANONICAL if unit not in spelled.DISTURBER_UNITS else spelled.ALIAS,
    )


def _identify(header: str, name: str, bracket: str) -> Column | None:
    """What a name without punctuation says, with the unit beside it."""
    if len(name) > 3 and name.lower() in spelled.TIMES:  # a column called "millis"
        name = f"time{name}"
    if match := spelled.TEMPERATURE.fullmatch(name + bracket):
        choices = [(spelled.BY_COLUMN["temperature"], spelled.ALIAS)]
        axes, number, suffix = [], match["after"], match["unit"]
    elif spelled.SCALAR_PART.fullmatch(name):
        choices = [(spelled.BY_COLUMN["quaternion"], spelled.ALIAS)]
        axes, number, suffix = ["w"], "", None
    elif match := spelled.WHOLE_NAME.fullmatch(name):
        choices = spelled.NAMES[match["name"].lower()]
        axes = [match[group] for group in ("before", "axis", "last") if match[group]]
        number, suffix = match["after"] or match["number"] or match["imu"] or "", match["unit"]
    elif match := spelled.BARE.fullmatch(name):
        choices = [(spelled.BY_COLUMN["field"], spelled.FALLBACK)]
        axes, number, suffix = [match["axis"]], match["after"], match["unit"]
    else:
        return None
    axis = "".join(axes).lower()
    for quantity, rank in choices:
        field = quantity.column == "field"
        bare = field and rank == spelled.FALLBACK
        last = rank == spelled.LAST and spelled.squash(header).lower() not in quantity.last.split()
        amiss = axis not in quantity.axes.split() and (axis or quantity.axes)
        if last or amiss or (bare and not _may_be_bare(suffix or bracket)):
            continue
        known, unit = _unit(quantity, suffix, bracket)
        if not known:
            continue
        if header == spelled.canonical_header(quantity.column, axis, unit):
            rank = spelled.CANONICAL
        if field and re.search("uncal|uncomp", name, re.IGNORECASE):
            rank = spelled.PREFERRED
        return Column(
            header=header, quantity=quantity, axis=axis, sensor=number, unit=unit, rank=rank
        )
    return None


def _may_be_bare(unit: str) -> bool:
    """Whether x, y or z alone with this unit, if any, can be a field: no "g", no unit of others."""
    with suppress(UnitError):
        return not unit or (find_unit(unit) != "" and unit not in spelled.GRAVITIES)
    return False


def _identify_with_sensor(
    header: str, name: str, unit: str, sensors: frozenset[str]
) -> Column | None:
    """What a name says behind the words that name a sensor."""
    tokens = spelled.TOKEN.findall(name)
    if len(tokens) > 1 and tokens[-1].lower() in ("imu", "gps", "gnss"):  # timestamp_sec_imu
        column = _identify(header, "".join(tokens[:-1]), unit)
        if column is None or column.quantity.column != "time":
            return None
        whose = tokens[-1].lower()
        return replace(column, axis="", sensor="" if whose == "imu" else whose)
    for before, rest in ((tokens[:at], "".join(tokens[at:])) for at in range(1, len(tokens))):
        if not unit and spelled.TIME_OR_TEMPERATURE.fullmatch(rest):
            return None
        if spelled.NO_READING.intersection(word.lower() for word in before):
            return None
        column = _identify(header, rest, unit)
        if column is None:
            continue
        quantity = column.quantity.column
        sensor = _name_sensor(before, column.quantity)
        bare = column.rank == spelled.FALLBACK and quantity in ("field", "time")
        written = (unit or re.sub(r"(?i)^[xyz](axis)?\d*", "", rest)).lower()
        of_field = column.unit in spelled.TESLA and written not in spelled.AMBIGUOUS
        if sensor is None or (bare and not of_field):  # other quantities have that unit too
            return None
        scalar = not column.axis and quantity != "time"
        if scalar and sensor and sensor not in sensors and "/" not in header:
            return None
        rank = spelled.ALIAS if quantity == "field" else column.rank
        if re.search("uncal|uncomp", "".join(before), re.IGNORECASE):
            rank = spelled.PREFERRED
        return replace(column, sensor=f"{sensor}{column.sensor}", rank=rank)
    return None


def name_quantity(header: str) -> str:
    """The quantity that a header names; "" where it is none."""
    column = identify_column(header)
    return "" if column is None else column.quantity.column


def is_unit(text: str) -> bool:
    """Whether a word is a unit of anything that a column can hold."""
    return spelled.squash(spelled.spell_out(text)).lower() in spelled.UNITS


def names_reading(name: str) -> bool:
    """Whether no word of a name says that it stands for something that no sensor reads."""
    return not spelled.NO_READING.intersection(word.lower() for word in spelled.TOKEN.findall(name))


def _name_sensor(words: Sequence[str], quantity: spelled.Quantity) -> str | None:
    """The sensor that words before a name stand for; `None` where they name another quantity."""
    kept = []
    for word in words:
        if word.lower() in spelled.IDLE:
            continue
        if not word.isascii():
            return None
        own = _identify(word, f"{word}x", "") or _identify(word, word, "")
        if own is None or own.rank == spelled.FALLBACK:
            kept.append(word)
        elif own.quantity.column == quantity.column or (
            own.quantity.column == "field" and quantity.column in _OF_MAGNETOMETER
        ):
            kept += [own.sensor] if own.sensor else []
        elif own.quantity.axes and quantity.column == "time":
            kept.append(word)  # acc_time
        elif not quantity.axes or own.quantity.axes:
            return None  # mag_heading
        else:
            kept.append(word)
    return "_".join(kept)


_OF_MAGNETOMETER = ("time", "temperature", "roll_deg", "pitch_deg", "unit")
"""What a column named for a magnetometer may hold beside its field: mag1_temp."""


def _unit(quantity: spelled.Quantity, suffix: str | None, bracket: str) -> tuple[bool, str | None]:
    """Whether the unit is one of the quantity's, and which; a bracket may hold a remark."""
    written = suffix or bracket
    if not written:
        return True, None
    if quantity.column == "field":
        with suppress(UnitError):
            return True, find_unit(written)
    elif written.lower() in spelled.UNITS:  # T (nT) is no time
        own = written.lower() in quantity.units
        return own, written.lower() if own else None
    return quantity.column in ("field", "time", "date") and not suffix, None
