"""Which column is what, where the headers of a file do not say: `time=t,x=mx,y=my,z=mz`.

The names on the left are canonical ones (`time_ms`, `acc_x_g`), x, y and z alone those of the
magnetometer; on the right stand the headers of the file, or numbers from 1 where it has none. They
are given with `--columns` or `read(columns=…)`, or kept beside the log, in a file with its name and
`.toml` behind it: `unit = "uT"`, and a table `[columns]` with lines such as `x = "mx"`.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from os.path import isfile
from pathlib import Path

from agonic.errors import LogError
from agonic.logs.headers.columns import name_documented
from agonic.logs.headers.header import LONGEST, Column, identify_column, name_quantity
from agonic.logs.headers.quantities import DOCUMENT, PARTS

_UNIT_BEHIND = re.compile(r"[,;(\[{]\s*([^,;(\[{}\])]+)[)\]}]?\s*$")

_DATE, _TIME_OF_DAY = DOCUMENT["parts"]["date"], DOCUMENT["parts"]["time"]
_PART_OF = {word: part for part, words in PARTS.items() for word in words.split()}
_IDLE = re.compile(r"(?i)utc|gmt|time|date|[\W\d_]+")
_STRENGTH = re.compile(r"[hH][_ ]?([xyzXYZ])(?=$|\s*[(\[])")
"""The field as its strength, H, which alone is taken for no more than a letter: Hz."""


@dataclass(frozen=True, kw_only=True)
class ColumnNames:
    """The headers of a file by the canonical names of what they hold, and the unit of the field.
    With `several` files the columns of a numbered sensor may be in others: they are left out of a
    file that has none of them."""

    headers: Mapping[str, str]
    unit: str | None = None
    where: str = "--columns"
    several: bool = False

    def rename(self, headers: Sequence[str]) -> list[str]:
        """The headers as they should be read: others for the same quantity become empty."""
        ours = {
            theirs: _canonical(name, self.unit, theirs) for name, theirs in self.headers.items()
        }
        if self.several:
            here = {_sensor(name) for theirs, name in ours.items() if theirs in headers}
            ours = {h: name for h, name in ours.items() if _sensor(name) in {"", *here}}
        if missing := [theirs for theirs in ours if theirs not in headers]:
            there = ", ".join(map(repr, headers[:12])) + (", …" if len(headers) > 12 else "")
            raise LogError(f"{self.where} names {missing[0]!r}; the columns are {there}")

        def replaced(header: str) -> tuple[str, str]:
            return _quantity(header), _sensor(header) if self.several else ""

        named = {replaced(name) for name in ours.values()}
        return [ours.get(h, "" if replaced(h) in named else h) for h in headers]


_given: ContextVar[ColumnNames | None] = ContextVar("given", default=None)
_in_force: ContextVar[ColumnNames | None] = ContextVar("in_force", default=None)
_scalar: ContextVar[str | None] = ContextVar("scalar", default=None)


def _canonical(name: str, unit: str | None, theirs: str = "") -> str:
    """The header that stands for a name on the left, with the unit that theirs has."""
    ours = f"mag_{name}" if name in "xyz" else name
    column = identify_column(ours)
    if column is None or column.unit is not None:
        return ours
    if written := _read_unit(ours, theirs, column):
        return f"{ours}_{written}"
    return f"{ours}_{unit}" if column.quantity.column == "field" and unit else ours


def _read_unit(ours: str, theirs: str, column: Column) -> str | None:
    """The unit that a header names: in brackets, as one that is understood, or behind its name."""
    tail = _UNIT_BEHIND.search(theirs)
    named = [identify_column(f"{ours} [{tail[1].strip()}]")] if tail else []
    own = identify_column(theirs)
    if own is not None and own.quantity == column.quantity:
        named.append(own)
    behind = re.search(r"_(nT|uT|[µμ]T|mT|mG|Gauss|gauss)$", theirs)
    if behind and column.quantity.column in ("field", "scalar"):
        named.append(identify_column(f"{ours}_{behind[1]}"))
    return next((one.unit for one in named if one is not None and one.unit is not None), None)


def _sensor(header: str) -> str:
    column = identify_column(header)
    return "" if column is None else column.sensor


def _quantity(header: str) -> str:
    name = name_quantity(header)
    return header if name in ("", "disturber") else name


def parse_names(text: str | Mapping[str, str], where: str = "--columns") -> ColumnNames:
    """The names in `time=t,x=mx,y=my,z=mz`, or in a mapping of such."""
    if isinstance(text, str):
        pairs = [pair.partition("=") for pair in text.split(",") if pair.strip()]
        if not all(sign and theirs.strip() for _, sign, theirs in pairs):
            raise LogError(f"{where} is {text!r}; it needs NAME=HEADER,…: time=t,x=mx,y=my,z=mz")
        headers = {ours.strip(): theirs.strip() for ours, _, theirs in pairs}
    else:
        headers = {str(ours): str(theirs) for ours, theirs in text.items()}
    for name in headers:
        if identify_column(_canonical(name, None)) is None:
            raise LogError(
                f"{where}: {name!r} is not a column; use time, x, y, z, temperature_C, acc_x_m_s2, "
                "gyro_x_rad_s, roll_deg, pitch_deg, heading_deg, current_A, heater_A …"
            )
    return ColumnNames(headers=headers, where=where)


def give_names(text: str | None) -> None:
    """Take these names for every log that is opened from now on, as a command does."""
    _given.set(None if text is None else parse_names(text))


def write_given_names() -> str:
    """The names that were given, as one types them; "" where none were."""
    given = _given.get()
    return "" if given is None else ",".join(f"{a}={b}" for a, b in given.headers.items())


@contextmanager
def naming_scalar(header: str | None) -> Iterator[None]:
    """While this lasts, the column with that header is the scalar instrument of logs opened."""
    token = _scalar.set(header)
    try:
        yield
    finally:
        _scalar.reset(token)


@contextmanager
def names_for(
    path: Path, columns: str | Mapping[str, str] | ColumnNames | None
) -> Iterator[ColumnNames | None]:
    """The names in force while a file is read: these, else the given ones, else those beside it."""
    if isinstance(columns, ColumnNames):
        found: ColumnNames | None = columns
    else:
        found = parse_names(columns, "columns") if columns else _given.get() or _read_beside(path)
        if (scalar := _scalar.get()) is not None:
            found = found or ColumnNames(headers={}, where="--scalar")
            found = replace(found, headers={**found.headers, "scalar": scalar})
    token = _in_force.set(found)
    try:
        yield found
    finally:
        _in_force.reset(token)


def _read_beside(path: Path) -> ColumnNames | None:
    """The names in the file beside a log, if there is one with a table of columns."""
    beside = Path(f"{path}.toml")
    if not isfile(beside):  # False too where the name is longer than names may be
        return None
    try:
        kept = tomllib.loads(beside.read_text("utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise LogError(f"{beside.name} cannot be read: {error}") from None
    columns, unit = kept.get("columns"), kept.get("unit")
    if not isinstance(columns, dict) or not isinstance(unit, str | None):
        raise LogError(f'{beside.name} needs a table [columns] with lines such as x = "mx"')
    names = parse_names(columns, beside.name)
    return ColumnNames(headers=names.headers, unit=unit, where=beside.name)


def _names_sensor(names: ColumnNames | None) -> bool:
    """Whether names are of more than a scalar instrument, which stands beside what is known."""
    return names is not None and [*names.headers] != ["scalar"]


def rename_headers(headers: Sequence[str], title: str = "") -> list[str]:
    """The headers as the names in force say, or the format of a table below these lines."""
    names = _in_force.get()
    named = headers if _names_sensor(names) else name_documented(headers, title)
    named = list(named) if names is None else names.rename(named)
    if any(re.fullmatch(r"[nu](?:ano|icro)?secs?", header) for header in named):  # beside sec
        named = [f"time_{header}" if header in ("sec", "s") else header for header in named]
    return _name_strength(_name_parts(named))


def _name_parts(headers: Sequence[str]) -> list[str]:
    """The headers, those of the parts of a moment with canonical names. `h`, `mm` and `Sec` mean
    that beside each other only."""
    found: list[str] = []
    for header in headers:
        word = _IDLE.sub("", header).lower() if len(header) < 24 else ""
        part = _PART_OF.get(word, "")
        if word in ("mm", "m"):
            before = next((one for one in reversed(found) if one), "")
            part = {"year": "month", "hour": "minute"}.get(before, "")
        found.append("" if part in found else part)
    timed = {"hour", "minute"} <= {*found}
    dated = "year" in found and ({"month", "day_of_month"} <= {*found} or "day_of_year" in found)
    wanted = {*(_DATE if dated else ()), *(_TIME_OF_DAY if timed else ())}
    return [part if part in wanted else h for h, part in zip(headers, found, strict=True)]


def _name_strength(headers: Sequence[str]) -> list[str]:
    """The headers, with `hx, hy, hz` as the field where all three are and no other field is."""
    axes = [match[1].lower() for h in headers if (match := _STRENGTH.match(h))]
    alone = sorted(axes) == [*"xyz"] and "field" not in map(_quantity, headers)
    return [_STRENGTH.sub(r"mag\1", h) for h in headers] if alone else list(headers)


def number_columns(width: int) -> list[str] | None:
    """Numbers from 1 for the columns of a table without a header, where names are in force."""
    return [str(k + 1) for k in range(width)] if _names_sensor(_in_force.get()) else None


def suggest_names(headers: Iterable[str]) -> str:
    """The option that would name the columns of a magnetometer, guessed from the headers."""
    known = [header for header in headers if len(header) <= LONGEST]
    free = [header for header in known if identify_column(header) is None]
    like = re.compile(r"time|clock|stamp|sec|ms$", re.IGNORECASE)
    time = next((h for h in known if _quantity(h) == "time" or like.search(h)), None)
    free = sorted((h for h in free if _may_be_field(h)), key=lambda h: h[:1].lower() not in "mbh")
    triples = (  # headers that differ in one letter
        [header[:at] + other + header[at + 1 :] for other in letters]
        for header in free
        for letters in ("xyz", "XYZ", "012", "123")
        for at, letter in enumerate(header)
        if letter == letters[0]
    )
    x, y, z = next((three for three in triples if {*three} <= {*free}), ["…"] * 3)
    parts = [f"time={time}"] * (time is not None) + [f"x={x}", f"y={y}", f"z={z}"]
    columns = ",".join(parts)
    return f"--columns {repr(columns) if ' ' in columns else columns} --unit uT"


def _may_be_field(header: str) -> bool:
    """Whether the unit of a header, if it has one in brackets, can be that of a field."""
    tail = _UNIT_BEHIND.search(header)
    written = identify_column(f"mag_x [{tail[1].strip()}]") if tail else None
    return tail is None or (written is not None and written.unit is not None)
