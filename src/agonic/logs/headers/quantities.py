"""The quantities that a table of readings can hold, and how loggers spell their names and units,
which is `quantities.toml`: in plain English letters, where headers are in the language of their
user. A word that is not known stays as it is, so that it is never taken for another.
"""

from __future__ import annotations

import re
import tomllib
import unicodedata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import inf
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
PARTS: Mapping[str, str] = {**DOCUMENT["parts"]["date"], **DOCUMENT["parts"]["time"]}
"""The parts of a moment, and what their columns are called."""
FIELD_UNITS = tuple(DOCUMENT["headers"]["field_units"].split())


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
    range: tuple[float, float] = (-inf, inf)

    @property
    def vector(self) -> bool:
        """Whether it has components."""
        return bool(self.axes)


def _make_quantity(row: Mapping[str, Any]) -> Quantity:
    parts: dict[str, Any] = {part: value for part, value in row.items() if part != "units"}
    texts = {part: " ".join(v.split()) for part, v in parts.items() if isinstance(v, str)}
    return Quantity(**{**parts, **texts}, units=_spell(row.get("units", {})))


QUANTITIES = tuple(map(_make_quantity, DOCUMENT["quantities"]))
DISTURBER = _make_quantity(DOCUMENT["disturber"])
"""Whatever may disturb: any name with one of these units behind it, in these letters."""
DISTURBER_UNITS: Mapping[str, str] = DOCUMENT["disturber_units"]
"""The unit in which a disturber is kept that was recorded in another: duty is 0…1, of 1…2 ms."""

BY_COLUMN = {quantity.column: quantity for quantity in QUANTITIES}


def canonical_header(column: str, axis: str = "", unit: str | None = None) -> str:
    """The name that `write_csv` gives to a column; the field's carries the unit of the samples."""
    quantity = BY_COLUMN[column]
    written = unit or "" if column in ("field", "second") else quantity.unit
    return "_".join(part for part in (quantity.name, axis, written) if part)


PREFERRED, CANONICAL, ALIAS, FALLBACK, LAST = range(5)
"""How well a header names its quantity: the lowest is taken."""


def squash(text: str) -> str:
    """Letters and digits only: "m/s2" → "ms2". A letter that is not known spoils the name."""
    return re.sub(r"[\W_]", "", text)


NAMES: dict[str, list[tuple[Quantity, int]]] = {}
for _quantity in QUANTITIES:
    for _rank, _names in (
        (ALIAS, f"{_quantity.name} {_quantity.aliases}"),
        (FALLBACK, _quantity.weak),
        (LAST, _quantity.last),
        (PREFERRED, _quantity.preferred),
    ):
        for _name in _names.split():
            NAMES.setdefault(squash(_name), []).append((_quantity, _rank))
UNITS = {*FIELD_UNITS, *(unit for q in QUANTITIES for unit in q.units)}


def _either(words: Iterable[str]) -> str:
    return "|".join(sorted(words, key=len, reverse=True))


_NAME = _either(NAMES).replace("|magn|", "|magn(?!t[xyz]?$)|")
"""magnT is mag in nT, as mag_nT[0], not magn in T."""
_BEFORE = "raw|imu|sensor|sensors|field|data|msg|message|header|vehicle|uncal|uncomp|cell"
_WITHIN = "vector|raw|adc|out|smooth|uncal|uncomp|buffer|data|values|readings"
WHOLE_NAME = re.compile(
    rf"(?:imu(?P<imu>\d+)|{_BEFORE})*?"
    rf"(?:(?P<before>[xyz])(?:axis)?)?(?P<name>{_NAME})(?:{_WITHIN})*(?P<number>\d*)(?P<axis>[xyz])?(?:axis)?"
    rf"(?P<after>\d*)(?:uncal|uncomp)?(?:in(?!t[xyz]?$))?(?P<unit>{_either(UNITS)})?(?P<last>[xyz])?",
    re.IGNORECASE,
)
SCALAR_PART = re.compile(
    rf"(?:{_BEFORE}|imu\d*)*?(?P<name>q|quat|quaternion|orientation|attitude|rotation)w",
    re.IGNORECASE,
)
BARE = re.compile(
    rf"(?:raw)?(?P<axis>[xyz])(?:axis|value)?(?P<after>\d*)(?P<unit>{_either(FIELD_UNITS)})?",
    re.IGNORECASE,
)
TIME_OR_TEMPERATURE = re.compile(r"T|[tT]\d+")
TEMPERATURE = re.compile(r"t(?P<after>\d*)(?P<unit>c|degc|celsius|k|degf|f|deg)", re.IGNORECASE)
"""A letter that stands for time, temperature and tesla: the unit says which."""
SCALED = re.compile(
    r"(?<![A-Za-z])(?:\d+\.\d+|(?<!\d)1(?:0{1,6}|[eE][-+]?\d+))\s?"
    r"(?=(?:[nuµμm]?T|m?G|m?A|C|g)[)\]}\s]*$)"
)
"""A factor before a unit, 0.1uT: the numbers are in no unit that is known."""
WITH_UNIT = (
    re.compile(r"(?P<name>[^(\[{]*[^\s(\[{])\s*[(\[{](?P<unit>[^)\]}]*)[)\]}]\s*"),
    re.compile(r"(?P<name>.*[)\]}].*[^\s(\[{])\s*[(\[{](?P<unit>[^()\[\]{}]{2,})[)\]}]\s*"),
    re.compile(r"(?P<name>[^,;]*\w)\s*[,;]\s*(?P<unit>[^,;]+)"),
    re.compile(r"(?P<name>.*\w)\s+/\s+(?P<unit>\S+)\s*"),
)
"""A name with a unit in brackets, the name perhaps with its own, behind a comma or a slash."""
IN = re.compile(r"^\s*(?:in|units?)\b[\s:=]*(?=\w)", re.IGNORECASE)
"""What may stand before a unit in words: x (in microteslas)."""
CODE = re.compile(r"^\s*0?x[0-9a-f]{2,8}\s*$", re.IGNORECASE)
"""What makers call a channel, no unit: X Mag [x8006]."""
INDEX = re.compile(r"(?<!q)(?<!quat)\[([012])\]|(?<!q)(?<!quat)\.0([012])\s*$", re.IGNORECASE)
ORDERED = re.compile(r"_?(wxyz|xyzw)_?\[?([0-3])\]?\s*$", re.IGNORECASE)
"""A component of a quaternion whose name states the order."""
UNCORRECTED = re.compile(r"un_?(cal|comp)(ibrated|ensated)?", re.IGNORECASE)
SHIMMER = re.compile(r"Shimmer_\w{4}_(\w+?)(?:_LN)?((?:_[XYZ])?)_(?:CAL|RAW|UNCAL)(?=$|\s*\()")
"""What the makers of Shimmer write around a name; of two accelerometers the one of low noise."""
EPOCH = re.compile(r"epoch(?=\s*[(\[_]\s*(?:ms|us|ns|s)[)\]]?$)", re.IGNORECASE)
"""Unix time with its unit, before local times beside it, whose zones are often wrong (MetaWear)."""
OF_GPS = {"timegpsweek": "gps_week", "timegpstow": "gps_tow"}
TOKEN = re.compile(r"[A-Z]?[a-z][a-z0-9]*|[A-Z][A-Z0-9]*(?![a-z])|\d+|[^\W_]+")
NO_READING = frozenset(DOCUMENT["headers"]["no_reading"].split())
"""Words before a name that say that the column is not what a sensor reads."""
IDLE = frozenset(_BEFORE.split("|")) | {"topic", "stamped", "buffer", "values", "log"}
TESLA, GRAVITIES, AMBIGUOUS = (
    tuple(DOCUMENT["headers"][name].split()) for name in ("tesla", "gravities", "ambiguous")
)
DISTURBER_NAME = re.compile(rf"(?P<name>[^\W\d]\w*)_(?P<unit>{_either(DISTURBER.units)})", re.ASCII)
"""The name of something that draws power or is magnetic, its unit behind it: heater_mA."""


_SIGNS = str.maketrans(
    {"μ": "u", "µ": "u", "°": "deg", "º": "deg", "%": "percent", "ʯ": "u", "℃": "degC"}
)

_BROKEN = tuple((re.compile(broken), whole) for whole, broken in DOCUMENT["broken"])
"""Signs that were read in another encoding than they were written in, or lost: of the units of a
field, or of a time, only µT and µs have a letter that can be."""

_ENGLISH: dict[str, str] = {
    theirs: ours for ours, words in DOCUMENT["words"].items() for theirs in words.split()
}
_IDEOGRAMS = {word: ours for word, ours in _ENGLISH.items() if ord(word[0]) > 0x2E80}
_IDEOGRAM = _either(_IDEOGRAMS)
_PAIR = re.compile(
    "|".join(rf"\b{a}\.?\s+{b}\b" for a, b in sorted(map(str.split, DOCUMENT["headers"]["pairs"]))),
    re.IGNORECASE,
)
ZONE = re.compile(r"[\s,;_(\[]*(?:UTC|GMT)\s*([+-])(\d{1,2})(?::?(\d\d))?[\s)\]]*$")
"""How the header of a time names its zone: `Date Time, GMT+03:00`."""
_WORD = re.compile(r"[^\W\d_]+")
_LOOK_ALIKE = dict(zip("АВЕКМНОРСТУХавекмнорстух", "ABEKMHOPCTYXabekmhopctyx", strict=True))
"""Cyrillic letters that a keyboard puts where Latin ones are meant: Вх, °С."""


def spell_out(text: str) -> str:
    """A header with its signs spelled out and the words that are known in English."""
    for broken, whole in _BROKEN:
        text = broken.sub(whole, text)
    plain = unicodedata.normalize("NFC", text).translate(_SIGNS)
    plain = plain.replace("\\mu", "u").replace("$", "")  # as in TeX
    if plain.isascii():
        return _translate(plain)
    plain = unicodedata.normalize("NFKC", plain).translate(_SIGNS)
    plain = re.sub(_IDEOGRAM, lambda word: f" {_IDEOGRAMS[word[0]]} ", plain)
    return _translate(plain)


def _translate(text: str) -> str:
    """The words of a text, single and in pairs, in English."""
    joined = _PAIR.sub(lambda pair: re.sub(r"[\s.]+", "", pair[0]), text)
    return _WORD.sub(lambda word: _translate_word(word[0]), joined)


def _translate_word(word: str) -> str:
    if len(word) > 1 and (known := _ENGLISH.get(word.lower())):
        return known
    latin = "".join(_LOOK_ALIKE.get(letter, letter) for letter in word)
    if len(word) == 1:
        return _ENGLISH.get(word, latin)
    return latin if latin.isascii() and (len(word) <= 3 or word[:3] == "deg") else word
