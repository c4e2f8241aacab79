"""Which column is what, where the headers of a file do not say: `time=t,x=mx,y=my,z=mz`.

The names on the left are canonical ones (`time_ms`, `temperature_C`, `acc_x_g`), x, y and z alone
those of the magnetometer; on the right stand the headers of the file, or numbers from 1 where it
has none. They are given with `--columns` or `read(columns=…)`, or kept beside the log, in a file
with its name and `.toml` behind it:

    unit = "uT"

    [columns]
    time = "t"
    x = "mx"
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from os.path import isfile
from pathlib import Path

from agonic.errors import LogError
from agonic.logs.columns import identify_column

_BESIDE = ".toml"
_AXES = "xyz"
_CLOCK = re.compile(r"time|clock|stamp|sec|ms$", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class ColumnNames:
    """The headers of a file by the canonical names of what they hold, and the unit of the field."""

    headers: Mapping[str, str]
    unit: str | None = None
    where: str = "--columns"

    def rename(self, headers: Sequence[str]) -> list[str]:
        """The headers as they should be read: others for the same quantity become empty.

        Raises `LogError` where a header is not there.

        >>> parse_names("time_s=t,x=a,y=b,z=c").rename(["t", "a", "b", "c", "mx"])
        ['time_s', 'mag_x', 'mag_y', 'mag_z', '']
        """
        ours = {theirs: _canonical(name, self.unit) for name, theirs in self.headers.items()}
        missing = [theirs for theirs in ours if theirs not in headers]
        if missing:
            there = ", ".join(map(repr, headers[:12])) + (", …" if len(headers) > 12 else "")
            raise LogError(f"{self.where} names {missing[0]!r}; the columns are {there}")
        named = {_quantity(name) for name in ours.values()}
        return [ours.get(h, "" if _quantity(h) in named else h) for h in headers]


_given: ContextVar[ColumnNames | None] = ContextVar("given", default=None)
_in_force: ContextVar[ColumnNames | None] = ContextVar("in_force", default=None)


def _canonical(name: str, unit: str | None) -> str:
    """The header that stands for a name on the left."""
    return "_".join(filter(None, ("mag", name, unit))) if name in _AXES else name


def _quantity(header: str) -> str:
    column = identify_column(header)
    return header if column is None else column.quantity.column


def parse_names(text: str | Mapping[str, str], where: str = "--columns") -> ColumnNames:
    """The names in `time=t,x=mx,y=my,z=mz`, or in a mapping of such.

    Raises `LogError` for a name that is no column's.
    """
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
                f"{where}: {name!r} is no column; use time, x, y, z, temperature_C, acc_x_m_s2, "
                "gyro_x_rad_s, roll_deg, pitch_deg, heading_deg, current_A …"
            )
    return ColumnNames(headers=headers, where=where)


def give_names(text: str | None) -> None:
    """Take these names for every log that is opened from now on, as a command does."""
    _given.set(None if text is None else parse_names(text))


@contextmanager
def names_for(path: Path, columns: str | Mapping[str, str] | None) -> Iterator[ColumnNames | None]:
    """The names in force while a file is read: these, else the given ones, else those beside it."""
    found = parse_names(columns, "columns") if columns else _given.get() or _read_beside(path)
    token = _in_force.set(found)
    try:
        yield found
    finally:
        _in_force.reset(token)


def _read_beside(path: Path) -> ColumnNames | None:
    """The names in the file beside a log, if there is one with a table of columns."""
    beside = path.with_name(path.name + _BESIDE)
    if not isfile(beside):  # False too where the name is longer than names may be
        return None
    try:
        told = tomllib.loads(beside.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise LogError(f"{beside.name} cannot be read: {error}") from None
    columns, unit = told.get("columns"), told.get("unit")
    if not isinstance(columns, dict) or not isinstance(unit, str | None):
        raise LogError(f'{beside.name} needs a table [columns] with lines such as x = "mx"')
    names = parse_names(columns, beside.name)
    return ColumnNames(headers=names.headers, unit=unit, where=beside.name)


def rename_headers(headers: Sequence[str]) -> list[str]:
    """The headers as the names in force say; as they are without any."""
    names = _in_force.get()
    return list(headers) if names is None else names.rename(headers)


def number_columns(width: int) -> list[str] | None:
    """Numbers from 1 for the columns of a table without a header, where names are in force."""
    return None if _in_force.get() is None else [str(k + 1) for k in range(width)]


def suggest_names(headers: Iterable[str]) -> str:
    """The option that would name the columns of a magnetometer, guessed from the headers.

    >>> suggest_names(["clock", "Sens0", "Sens1", "Sens2"])
    '--columns time=clock,x=Sens0,y=Sens1,z=Sens2 --unit uT'
    """
    known = list(headers)
    free = [header for header in known if identify_column(header) is None]
    time = next((h for h in known if _quantity(h) == "time" or _CLOCK.search(h)), None)
    x, y, z = next(filter(None, (_find_triple(h, free) for h in free)), ("…",) * 3)
    parts = [f"time={time}"] * (time is not None) + [f"x={x}", f"y={y}", f"z={z}"]
    columns = ",".join(parts)
    return f"--columns {repr(columns) if ' ' in columns else columns} --unit uT"


def _find_triple(first: str, headers: Sequence[str]) -> tuple[str, str, str] | None:
    """Three headers that differ in one letter: x, y, z, or 0, 1, 2, or 1, 2, 3."""
    for letters in ("xyz", "XYZ", "012", "123"):
        for at, letter in enumerate(first):
            others = [first[:at] + other + first[at + 1 :] for other in letters[1:]]
            if letter == letters[0] and all(other in headers for other in others):
                return first, others[0], others[1]
    return None
