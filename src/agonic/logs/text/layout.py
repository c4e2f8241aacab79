"""How a text table is laid out: its separator, its header, where its rows start, and what the
lines before it state of all rows: a sampling rate, the unit of the field, in logs of Gyroflow the
factors of counts.

Source: Gyroflow documentation, `.gcsv` format: `t` times `tscale` is seconds, `gx` times `gscale`
rad/s, `ax` times `ascale` g, `mx` times `mscale` gauss; `timestamp` is the start in Unix seconds.
"""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError, UnitError
from agonic.logs.contents import to_number
from agonic.logs.headers.columns import find_quantities, refuse_many
from agonic.logs.headers.header import identify_column
from agonic.logs.headers.quantities import AMBIGUOUS
from agonic.units import find_unit

_SCALES = {
    "t": ("tscale", "time_s"),
    **{f"m{axis}": ("mscale", f"mag_{axis}_G") for axis in "xyz"},
    **{f"a{axis}": ("ascale", f"acc_{axis}_g") for axis in "xyz"},
    **{f"g{axis}": ("gscale", f"gyro_{axis}_rad_s") for axis in "xyz"},
}
"""The factor of each column, and its name once that is applied."""


def scale_columns(
    table: Mapping[str, NDArray[Any]], above: Sequence[str]
) -> dict[str, NDArray[Any]]:
    """The columns in the units that the lines above them state; one without a factor stays.

    >>> scale_columns({"t": np.array([0, 5])}, ["tscale,0.001"])["time_s"].tolist()
    [0.0, 0.005]
    """
    pairs = (line.replace(":", ",").split(",", 1) for line in above if line.strip())
    stated = {pair[0].strip(): to_number(pair[1]) for pair in pairs if len(pair) == 2}
    scaled = {}
    for header, values in table.items():
        factor, name = _SCALES.get(header, ("", ""))
        if np.isfinite(stated.get(factor, np.nan)):
            scaled[name] = values * stated[factor]
        else:
            scaled[header] = values
    start = stated.get("timestamp", np.nan)
    if np.isfinite(start) and scaled:
        scaled["epoch_unix_s"] = np.full(len(next(iter(scaled.values()))), start)
    return scaled


def add_stated(table: Table, layout: Layout) -> Table:
    """The columns, with a unit and times from those lines where no column tells them."""
    if layout.unit and table and "unit" not in find_quantities(table).values():
        rows = len(next(iter(table.values())))
        table = {**table, "unit": np.full(rows, layout.unit, dtype=object)}
    return _add_rate(table, layout)


def _add_rate(table: Table, layout: Layout) -> Table:
    """The columns, with times from the sampling rate where no column is a clock."""
    if layout.rate_Hz is None or not table:
        return table
    clocks = {h for h, quantity in find_quantities(table).items() if quantity == "time"}
    empty = {h for h in clocks if table[h].dtype.kind == "f" and np.isnan(table[h]).all()}
    if clocks - empty:
        return table
    rows = len(next(iter(table.values())))
    others = {header: values for header, values in table.items() if header not in empty}
    return {**others, "time_s": np.arange(rows) / layout.rate_Hz}


Table = dict[str, NDArray[Any]]
"""The columns of a text table, by header."""

COMMENT = "#%"
NUMBER = r"[-+]?(?:\d++\.?+\d*+|\.\d++)(?:[eE][-+]?\d++)?+"
"""A number in a text; possessive, so that long digits cost once."""
STAMP = r"(?:\d{4}-\d\d-\d\d[T ])?\d\d:\d\d:\d\d[.,]\d+"
"""A moment as terminals and loggers write it before a line, to a part of a second."""
HEXADECIMAL = re.compile(r"0[xX][0-9a-fA-F]{1,16}")
_NUMERIC = re.compile(rf"{HEXADECIMAL.pattern}|[-+]?\d+,\d+(?:[eE][-+]?\d+)?")
"""What is a number and no word, though no float: a register, a decimal comma."""
LABVIEW = "LabVIEW Measurement"
SAMPLE = 200
LONGEST_LINE = 1_000_000

_HOLDS = re.compile(r"\w")
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
_BRACKETS = str.maketrans("", "", "()[]{}")
_SEPARATED = re.compile(r"sep=(.)", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class Layout:
    """How a text table is laid out; a `separator` of `None` means blanks.

    `start` is the line of the first row, `width` the number of its cells, `rate_Hz` what the lines
    before the table state, `comma` whether numbers have a decimal comma, `unit` that of the field
    by those lines.
    """

    separator: str | None
    header: list[str]
    start: int
    width: int
    comma: bool = False
    rate_Hz: float | None = None
    unit: str = ""
    notes: tuple[str, ...] = ()

    def split(self, line: str) -> list[str]:
        """The cells of a line, with a decimal point in their numbers.

        >>> Layout(separator=",", header=[], start=0, width=2, comma=True).split('"0,5","1,25"')
        ['0.5', '1.25']
        """
        if self.comma and self.separator != ",":
            return split_cells(line.replace(",", "."), self.separator)
        cells = split_cells(line, self.separator)
        return [cell.replace(",", ".") for cell in cells] if self.comma else cells


def holds_values(line: str) -> bool:
    """Whether a line is neither empty nor a comment."""
    return bool(line) and line[0] not in COMMENT and not line.isspace()


def sample_lines(lines: Sequence[str]) -> list[int]:
    """The first lines with values in them; those of nothing but separators have none."""
    return list(
        islice((i for i, line in enumerate(lines) if holds_values(line) and _HOLDS.search(line)),
               SAMPLE)
    )  # fmt: skip


def find_layout(lines: Sequence[str], sample: Sequence[int]) -> Layout:
    """The layout that the sample of lines with values shows."""
    if not sample:
        raise LogError("there are no lines with values in it")
    separator = _find_separator([lines[i] for i in sample])
    counts = [count_cells(lines[i], separator) for i in sample]
    width = Counter(counts).most_common(1)[0][0]
    refuse_many(width)
    at = next(k for k in range(len(sample)) if _begins(lines[sample[k]], separator, width))
    notes = (f"{at} lines before the table skipped",) * (at > 0)
    first = split_cells(lines[sample[at]], separator)
    rate = _find_rate(lines[: sample[at]])
    start = sample[at]
    headed = is_header(first)
    comma = _has_decimal_comma([lines[i] for i in sample[at + headed :]], separator)
    if headed:
        header = first
        if at + 1 < len(sample) and _is_row_of_units(lines[sample[at + 1]], separator, first):
            at += 1
            units = split_cells(lines[sample[at]], separator)
            header = [_with_unit(name, unit) for name, unit in zip(first, units, strict=False)]
        start = sample[at] + 1
    else:
        from agonic.logs.text.headless import name_columns

        rows = [split_cells(lines[i], separator) for i in sample[at:]]
        last = lines[sample[at - 1]] if at else ""
        before = reversed(lines[:start])
        comment = next((line for line in before if line and not holds_values(line)), "")
        header, said = name_columns(
            _take_words(last, separator), _take_words(comment.strip(f"{COMMENT} "), separator),
            rows, hashed=comment.startswith("# "),
        )  # fmt: skip
        notes += said
    return Layout(
        separator=separator, header=header, start=start, width=width, comma=comma,
        rate_Hz=rate, unit=_find_unit(lines[:start]), notes=notes,
    )  # fmt: skip


def _begins(line: str, separator: str | None, width: int) -> bool:
    """Whether a table of so many cells may begin here; its rows may end in a separator."""
    count = count_cells(line, separator)
    if count == width:
        return True
    return separator is not None and count == width - 1 and is_header(split_cells(line, separator))


def _has_decimal_comma(rows: Sequence[str], separator: str | None) -> bool:
    """Whether numbers have a decimal comma; between commas only such in quotes can."""
    if separator != ",":
        return any("," in row for row in rows)
    quoted = [cell for row in rows if '"' in row for cell in split_cells(row, ",")]
    return any(map(_DECIMAL.fullmatch, quoted)) and not any("." in cell for cell in quoted)


def _take_words(line: str, separator: str | None) -> list[str]:
    """The cells of a line, if most of them are words."""
    cells = split_cells(line, separator)
    return cells if is_header(cells) else []


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


def _is_row_of_units(line: str, separator: str | None, header: Sequence[str]) -> bool:
    """Whether a line below the header holds units that make sense behind the names."""
    units = split_cells(line, separator)
    if len(units) != len(header) or not is_header([unit.replace(",", "") for unit in units]):
        return False
    words = [(h, u) for h, u in zip(header, units, strict=True) if u and math.isnan(to_number(u))]
    known = [identify_column(_with_unit(name, unit)) for name, unit in words]
    stated = sum(column is not None and column.unit is not None for column in known)
    return stated >= 2 or (stated == 1 and len(words) == sum(map(bool, units)))


def _with_unit(name: str, unit: str) -> str:
    plain = unit.translate(_BRACKETS).strip()
    return f"{name} ({plain})" if plain else name


def _find_separator(rows: Sequence[str]) -> str | None:
    """The separator that splits most rows alike, best one that splits the first row so too."""
    if stated := _SEPARATED.fullmatch(rows[0].strip(' "')):
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
