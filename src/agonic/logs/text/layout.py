"""How a text table is laid out: its separator, its header, where its rows start, what the lines
before it state of all rows; without a line of names, the names of its columns: those in a comment,
or by what the columns do.
"""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import islice, pairwise
from typing import Any

from numpy.typing import NDArray

from agonic.errors import LogError, UnitError
from agonic.logs.contents import to_number
from agonic.logs.headers.column_names import number_columns
from agonic.logs.headers.columns import refuse_many
from agonic.logs.headers.header import identify_column
from agonic.logs.headers.quantities import AMBIGUOUS
from agonic.units import find_unit

Table = dict[str, NDArray[Any]]
"""The columns of a text table, by header."""

COMMENT = "#%"
NUMBER = r"[-+]?(?:\d++\.?+\d*+|\.\d++)(?:[eE][-+]?\d++)?+"
"""A number in a text; possessive, so that long digits cost once."""
STAMP = r"(?:\d{4}-\d\d-\d\d[T ])?\d\d:\d\d:\d\d[.,]\d+"
"""A moment as terminals and loggers write it before a line, to a part of a second."""
HEXADECIMAL = re.compile(r"0[xX][0-9a-fA-F]{1,16}")
_NUMERIC = re.compile(
    rf"{HEXADECIMAL.pattern}|[-+]?\d+,\d+(?:[eE][-+]?\d+)?|[-+]?\d+(?:[\s'’.,]\d{{3}})+(?:[.,]\d*)?"
    r"|[-+]?\d*\.?\d+[dD][-+]?\d+"
)
"""What is a number and no word, though no float: a register, a decimal comma, thousands apart, an
exponent of Fortran."""
_POINTS = re.compile(r"[-+]?\d{1,3}(?:\.\d{3})+,\d+")
"""A decimal comma, and points between the thousands."""
_COMMAS = re.compile(r"\d,\d{3}\.\d")
"""A decimal point, and commas between the thousands."""
LABVIEW = "LabVIEW Measurement"
SAMPLE = 200
LONGEST_LINE = 1_000_000

_RATE = re.compile(
    r"[\W_]*(?:fs|odr|(?:sampl\w*|update|output|data|logging)?[\s_-]*(?:rate|freq\w*)"
    r"(?:\s*setting)?)\W*(?:\[?hz\]?\W*)?(\d+(?:[.,]\d+)?)\s*(k?hz)?[\W_]*",
    re.IGNORECASE,
)
_UNIT = re.compile(r"[#%/\s]*units?\s*(?:is|are|:|=)\s*[(\[]?([^\W\d]\w*)[)\]]?", re.IGNORECASE)
_DECIMAL = re.compile(r"[-+]?\d*,(?:\d{1,2}|\d{4,})(?:[eE][-+]?\d+)?")
"""A number with a comma that cannot stand between thousands."""
_NUMBERS = re.compile(
    r"[-+]?[\d.,]+(?:e[-+]?\d+)?(?:\s+[-+]?[\d.,]+(?:e[-+]?\d+)?)+", re.IGNORECASE
)
"""Several numbers in a cell: what stands between the cells is blanks."""


@dataclass(frozen=True, kw_only=True)
class Layout:
    """How a text table is laid out; a `separator` of `None` means blanks. `start` is the line of
    the first row, `width` the number of its cells, `rate_Hz` what the lines before the table state,
    `comma` whether numbers have a decimal comma, `unit` that of the field by those lines, `units`
    those behind the numbers of columns, by position."""

    separator: str | None
    header: list[str]
    start: int
    width: int
    comma: bool = False
    rate_Hz: float | None = None
    unit: str = ""
    notes: tuple[str, ...] = ()
    units: Mapping[int, str] = field(default_factory=dict)

    def split(self, line: str) -> list[str]:
        """The cells of a line, with a decimal point in their numbers."""
        cells = split_cells(line, self.separator)
        if not self.comma:
            return cells
        plain = (cell.replace(".", "") if _POINTS.fullmatch(cell) else cell for cell in cells)
        return [cell.replace(",", ".") for cell in plain]


def holds_values(line: str) -> bool:
    """Whether a line is neither empty nor a comment."""
    return bool(line) and line[0] not in COMMENT and not line.isspace()


def sample_lines(lines: Sequence[str]) -> list[int]:
    """The first lines with values in them; those of nothing but separators have none."""
    written = (i for i, line in enumerate(lines) if holds_values(line) and re.search(r"\w", line))
    return list(islice(written, SAMPLE))


def find_layout(lines: Sequence[str], sample: Sequence[int]) -> Layout:
    """The layout that the sample of lines with values shows."""
    if not sample:
        raise LogError("there are no lines with values in it")
    separator = _find_separator([lines[i] for i in sample])
    counts = [count_cells(lines[i], separator) for i in sample]
    width = Counter(counts).most_common(1)[0][0]
    refuse_many(width)
    # rows may end in a separator that their header has not
    at = next(
        k
        for k, (i, count) in enumerate(zip(sample, counts, strict=True))
        if count == width
        or (separator and count == width - 1 and is_header(split_cells(lines[i], separator)))
    )
    notes = (f"{at} lines before the table skipped",) * (at > 0)
    start = sample[at]
    above = lines[:start]
    header = split_cells(lines[start], separator)
    headed = is_header(header)
    comma = _has_decimal_comma([lines[i] for i in sample[at + headed :]], separator)
    if headed:
        below = [split_cells(lines[i], separator) for i in sample[at + 1 : at + 3]]
        if below and (joined := _join_groups(header, below[0])):
            at, header, below = at + 1, joined, below[1:]
        units = below[0] if below else []
        if _are_units(units, header):
            at += 1
            header = [_with_unit(name, unit) for name, unit in zip(header, units, strict=True)]
            at += len(below) > 1 and is_header(below[1])  # Smp, Avg: how a logger took them
        start = sample[at] + 1
    else:
        comment = next((line for line in reversed(above) if line and not holds_values(line)), "")
        above = (lines[sample[at - 1]] if at else "", comment.strip(f"{COMMENT} "))
        words = (split_cells(line, separator) for line in above)
        before, said = (cells if is_header(cells) else [] for cells in words)
        rows = [split_cells(lines[i], separator) for i in sample[at:]]
        header = _name_columns(before, said, rows, hashed=comment.startswith("# "))
        if taken := _TAKEN.get(header[0]) if header[-3:] == [*"xyz"] else None:
            notes += (f"there is no header: {taken}, the others as x, y and z of a magnetometer",)
    return Layout(
        separator=separator, header=header, start=start, width=width, comma=comma,
        rate_Hz=_find_rate(lines[:start]), unit=_find_unit(lines[:start]), notes=notes,
    )  # fmt: skip


_CALENDAR = ("year", "month", "day_of_month", "hour", "minute", "second_of_minute")
_TAKEN = {
    "time": "the first column grows steadily and is taken as the time",
    "year": "the first six columns are taken as year to second",
}
"""What is said of the columns before x, y and z that no header names, by the first of them."""


def _name_columns(
    above: list[str], comment: list[str], rows: Sequence[Sequence[str]], *, hashed: bool
) -> list[str]:
    """The header of rows, from the words of the line above them or of the last comment before them,
    else x, y, z. One of one more cell above is taken where no column can be behind it ("Comment");
    in a comment that a hash and a blank begin (`hashed`) the hash may be the name of a count of
    rows."""
    width = len(rows[0])
    if len(above) == width + 1 and identify_column(above[-1]) is None:
        return above[:-1]
    if hashed and len(comment) == width - 1 and _counts_rows(rows):
        return ["#", *comment]
    if comment and len(comment) == width:
        return comment
    if numbers := number_columns(width):
        return numbers
    if 2 * len(above) == width:
        raise LogError(
            f"the header has {len(above)} names and the rows have {width} cells: with decimal "
            "commas, cells must be separated by something else (a semicolon)"
        )
    if width == 4 and (name := _name_first(rows)):
        return [name, *"xyz"]
    moments = [[to_number(cell) for cell in row[:6]] for row in rows]
    if width == 9 and all(map(_begins_with_moment, rows)) and moments == sorted(moments):
        return [*_CALENDAR, *"xyz"]
    if width != 3:
        raise LogError(
            f"{width} columns and no header; name them in a first line such as "
            "time_s,mag_x_uT,mag_y_uT,mag_z_uT (three columns alone are taken as x, y, z), or say "
            "by their numbers which are which, as in --columns "
            f"{_example_of(width, rows[0])} --unit uT"
        )
    return list("xyz")


def _name_first(rows: Sequence[Sequence[str]]) -> str:
    """What the first of four columns is without a name: a clock by its steady steps from row to
    row, a count of rows by steps of one; "" where it may be anything."""
    values = [to_number(row[0]) for row in rows if len(row) == len(rows[0])]
    steps = sorted(after - before for before, after in pairwise(values))
    if len(steps) < 20 or not steps[0] > 0:  # what is measured goes up and down
        return ""
    if _counts_rows(rows):
        return "row"
    usual = steps[len(steps) // 2]
    steady = sum(usual / 2 < step < 2 * usual for step in steps)
    return "time" if steady > 0.9 * len(steps) else ""


def _counts_rows(rows: Sequence[Sequence[str]]) -> bool:
    """Whether the first column counts the rows, from zero or one."""
    values = [to_number(row[0]) for row in rows if row]
    return bool(values) and values[0] in (0.0, 1.0) and all(b - a == 1 for a, b in pairwise(values))


def _example_of(width: int, first: Sequence[str]) -> str:
    """What to write of a table of so many columns, and with such a first row."""
    if width > 8 and _begins_with_moment(first):
        return "year=1,month=2,day=3,hour=4,minute=5,second=6,x=7,y=8,z=9"
    known = {4: "time=1,x=2,y=3,z=4", 9: "acc_x_g=1,acc_y_g=2,acc_z_g=3,x=7,y=8,z=9"}
    return known.get(width, "time=…,x=…,y=…,z=…")


def _begins_with_moment(row: Sequence[str]) -> bool:
    """Whether the first six cells may be a year, month, day, hour, minute and second."""
    ends = zip((1900, 1, 1, 0, 0, 0), (2100, 13, 32, 25, 60, 61), strict=True)
    parts = zip(map(to_number, row), ends, strict=False)
    return all(low <= part < end and (end == 61 or part.is_integer()) for part, (low, end) in parts)


def _has_decimal_comma(rows: Sequence[str], separator: str | None) -> bool:
    """Whether numbers have a decimal comma; between commas only such in quotes can."""
    if separator != ",":
        commas = [row for row in rows if "," in row]
        return bool(commas) and not any(map(_COMMAS.search, commas))
    quoted = [cell for row in rows if '"' in row for cell in split_cells(row, ",")]
    return any(map(_DECIMAL.fullmatch, quoted)) and not any("." in cell for cell in quoted)


def _find_rate(lines: Sequence[str]) -> float | None:
    """The sampling rate, Hz, that lines before a table state."""
    for line in lines:
        if match := _RATE.fullmatch(line.strip(" ;,\t")):
            rate = float(match[1].replace(",", "."))
            rate *= 1000.0 if (match[2] or "").lower() == "khz" else 1.0
            return rate if 0 < rate < math.inf else None
    return None


def _find_unit(lines: Sequence[str]) -> str:
    """The unit of a field that lines before a table state; "" for none, or one of others too."""
    for line in lines:
        if match := _UNIT.fullmatch(line.strip()):
            with suppress(UnitError):
                return find_unit(match[1]) if match[1].lower() not in AMBIGUOUS else ""
    return ""


def _join_groups(groups: Sequence[str], names: Sequence[str]) -> list[str]:
    """The header of names below those of their groups, each of which stands over the first of its
    columns: Magnetometer over x, y and z; none where that tells no field, or the groups do."""
    filled = list(groups)
    for at in range(1, len(filled)):
        filled[at] = filled[at] or filled[at - 1]
    if len(names) != len(groups) or len(set(filled)) == len(filled) or not is_header(names):
        return []
    joined = [f"{group} {name}".strip() for group, name in zip(filled, names, strict=True)]
    return joined if tell_field(joined) and not tell_field(groups) else []


def tell_field(header: Iterable[str]) -> bool:
    """Whether three columns are the axes of a field."""
    found = [column for column in map(identify_column, header) if column is not None]
    return {column.axis for column in found if column.quantity.column == "field"} == set("xyz")


def _are_units(units: Sequence[str], header: Sequence[str]) -> bool:
    """Whether the cells below a header are units that make sense behind the names."""
    if len(units) != len(header) or not is_header(units):
        return False
    words = [(h, u) for h, u in zip(header, units, strict=True) if u and math.isnan(to_number(u))]
    known = [identify_column(_with_unit(name, unit)) for name, unit in words]
    stated = sum(column is not None and column.unit is not None for column in known)
    return stated >= 2 or (stated == 1 and len(words) == sum(map(bool, units)))


def _with_unit(name: str, unit: str) -> str:
    plain = re.sub(r"[()\[\]{}]", "", unit).strip()
    return f"{name} ({plain})" if plain else name


def _find_separator(rows: Sequence[str]) -> str | None:
    """The separator that splits most rows alike, best one that splits the first row so too."""
    if stated := re.fullmatch("(?i:sep)=(.)", rows[0].strip(' "')):
        return str(stated[1])
    alike = []
    for separator in (";", "\t", ",", "|"):
        widths = [count_cells(row, separator) for row in rows]
        width, times = Counter(widths).most_common(1)[0]
        first, last = (split_cells(rows[k], separator) for k in (0, -1))
        headed = len(first) == width and is_header(first)
        if any(map(_NUMBERS.fullmatch, first if headed else last)):
            continue
        if width > 1 and 2 * times > len(rows):
            alike.append((widths[0] != width, separator))
    return min(alike, key=lambda found: found[0])[1] if alike else None


def split_cells(line: str, separator: str | None) -> list[str]:
    """The cells of a line."""
    if separator is None:
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        return next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    except csv.Error as error:
        raise LogError(f"a cell in quotes has no end ({error}); fetch it again") from None


def count_cells(line: str, separator: str | None) -> int:
    """How many cells a line has; separators are counted where none can stand in quotes."""
    if separator is None or '"' in line:
        return len(split_cells(line, separator))
    return line.count(separator) + 1


def is_header(cells: Sequence[str]) -> bool:
    """Whether most of the cells that are not empty are words."""
    words = [
        math.isnan(to_number(cell)) and cell.lower() != "nan" and not _NUMERIC.fullmatch(cell)
        for cell in cells
        if cell
    ]
    return 2 * sum(words) > len(words)
