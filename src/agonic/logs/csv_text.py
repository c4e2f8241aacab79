"""Text tables: comma, semicolon, tab or blanks between the cells, with a header or without.

Understood are comments (#, %), a header in the last comment line, lines before the header, quoted
cells, a decimal comma where the separator is a semicolon or a tab, UTF-8 and UTF-16 with their
marks, other bytes as Latin-1, and the ends of lines of every system. Three numbers a line without
a header are a point cloud in raw units. A cell that is no number becomes NaN, and `Samples`
rejects and counts the row. `columns` tells what the headers mean.
"""

from __future__ import annotations

import codecs
import csv
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.columns import find_columns, identify_column, refuse_many
from agonic.logs.contents import to_number
from agonic.logs.log import Log
from agonic.logs.table import build_log
from agonic.provenance import Input

_COMMENT = "#%"
_SAMPLE = 200
_BLOCK = 50_000
"""Rows parsed at once: one bad cell sends its block, not the file, the slow way."""
_LONGEST_LINE = 1_000_000
_LABELS = ("date", "sensor", "frame")
_TEXTUAL = ("time", "latitude_deg", "longitude_deg")
_MOTIONCAL = "Raw:"  # among lines of other kinds (Uni:, Ori:, Cal1:)
_MOTIONCAL_COLUMNS = {
    **{f"acc_{axis}_g": 1 / 8192 for axis in "xyz"},
    **{f"gyro_{axis}_deg_s": 1 / 16 for axis in "xyz"},
    **{f"mag_{axis}_mG": 1.0 for axis in "xyz"},
}
"""One count of each column of a MotionCal line (PaulStoffregen/MotionCal: imuread.h, where a
magnetic count is 0.1 µT)."""


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that a text table is; `unit` is that of the field where no header names one."""
    table, facts = read_table(path)
    return build_log(table, path=path, source=source, unit=unit, **facts)


def read_table(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """The columns of a text table that are understood, by header, and what to tell of the file."""
    lines, notes = _split_lines(path.read_bytes())
    sample = list(islice((i for i, line in enumerate(lines) if _holds_values(line)), _SAMPLE))
    if not sample:
        raise LogError("there are no lines with values in it")
    if max(len(lines[i]) for i in sample) > _LONGEST_LINE:
        raise LogError(f"a line is longer than {_LONGEST_LINE} characters: this is no table")
    if 4 * sum(lines[i].startswith(_MOTIONCAL) for i in sample) > len(sample):
        table = _read_motioncal([line for line in lines if line.startswith(_MOTIONCAL)])
        return table, {"format": "MotionCal text", "notes": notes}
    layout = _find_layout(lines, sample)
    wanted = find_columns(layout.header)
    rows = [line for line in islice(lines, layout.start, None) if _holds_values(line)]
    if not rows:
        raise LogError("there is a header and no row below it")
    return _make_table(rows, layout.separator, wanted), {
        "format": "text table",
        "others": [name for i, name in enumerate(layout.header) if i not in wanted],
        "notes": (*notes, *layout.notes),
    }


def _split_lines(data: bytes) -> tuple[list[str], tuple[str, ...]]:
    """The lines of a file in any of the usual encodings, and a note where the bytes are odd."""
    notes: tuple[str, ...] = ()
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = data.decode("utf-16", "replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
            notes = ("some bytes are not UTF-8: read as Latin-1",)
    return text.replace("\0", "").replace("\r\n", "\n").replace("\r", "\n").split("\n"), notes


def _holds_values(line: str) -> bool:
    return bool(line) and line[0] not in _COMMENT and not line.isspace()


@dataclass(frozen=True, kw_only=True)
class _Layout:
    """How a text table is laid out; a `separator` of `None` means blanks."""

    separator: str | None
    header: list[str]
    start: int
    notes: tuple[str, ...] = ()


def _find_layout(lines: Sequence[str], sample: Sequence[int]) -> _Layout:
    """The layout that the sample of lines with values shows."""
    separator = _find_separator([lines[i] for i in sample])
    counts = [_count_cells(lines[i], separator) for i in sample]
    width = Counter(counts).most_common(1)[0][0]
    refuse_many(width)
    widths = (width,) if separator is None else (width, width - 1)  # rows may end in a separator
    at = next(k for k, count in enumerate(counts) if count in widths)
    notes = (f"{at} lines before the table skipped",) * (at > 0)
    first = _split_cells(lines[sample[at]], separator)
    if _is_header(first):
        return _Layout(separator=separator, header=first, start=sample[at] + 1, notes=notes)
    start = sample[at]
    comment = next((lines[i] for i in reversed(range(start)) if not _holds_values(lines[i])), "")
    header = _split_cells(comment.strip(f"{_COMMENT} "), separator)
    if len(header) != width or not _is_header(header):
        if width != 3:
            raise LogError(
                f"{width} columns and no header; name them in a first line such as "
                "time_s,mag_x_uT,mag_y_uT,mag_z_uT (three columns alone are taken as x, y, z)"
            )
        header = list("xyz")
    return _Layout(separator=separator, header=header, start=start, notes=notes)


def _find_separator(rows: Sequence[str]) -> str | None:
    """The separator that splits most rows alike, best one that splits the first row so too."""
    alike = []
    for separator in (";", "\t", ","):
        widths = [_count_cells(row, separator) for row in rows]
        width, times = Counter(widths).most_common(1)[0]
        if width > 1 and 2 * times > len(rows):
            alike.append((widths[0] != width, separator))
    return min(alike, key=lambda found: found[0])[1] if alike else None


def _split_cells(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    return next(csv.reader([line], delimiter=separator, skipinitialspace=True))


def _count_cells(line: str, separator: str | None) -> int:
    """How many cells a line has; separators are counted where none can stand in quotes."""
    if separator is None or '"' in line:
        return len(_split_cells(line, separator))
    return line.count(separator) + 1


def _is_header(cells: Sequence[str]) -> bool:
    """Whether most of the cells that are not empty are words."""
    words = [math.isnan(to_number(cell)) and cell.lower() != "nan" for cell in cells if cell]
    return 2 * sum(words) > len(words)


def _make_table(
    rows: Sequence[str], separator: str | None, wanted: dict[int, str]
) -> dict[str, NDArray[Any]]:
    """The wanted columns by name: texts where they hold texts, numbers otherwise."""
    if separator in (";", "\t"):
        rows = [row.replace(",", ".") for row in rows]
    first = [_split_cells(row, separator) for row in rows[:_SAMPLE]]
    texts = {i: name for i, name in wanted.items() if _holds_texts(name, i, first)}
    numeric = [i for i in wanted if i not in texts]
    values = _read_numbers(rows, separator, numeric)
    table: dict[str, NDArray[Any]] = {wanted[i]: values[:, k] for k, i in enumerate(numeric)}
    cells = [_split_cells(row, separator) for row in rows] if texts else []
    for i, name in texts.items():
        table[name] = np.array([row[i] if i < len(row) else "" for row in cells], dtype=object)
    return table


def _holds_texts(name: str, at: int, rows: Sequence[Sequence[str]]) -> bool:
    """Whether a column may hold texts and most of its first cells do; a label is always one."""
    column = identify_column(name)
    quantity = "" if column is None else column.quantity.column
    if quantity in _TEXTUAL:
        return _is_header([cell for row in rows for cell in row[at : at + 1]])
    return quantity in _LABELS


def _read_numbers(rows: Sequence[str], separator: str | None, columns: Sequence[int]) -> Array:
    """The numbers in the given columns, (n, k); NaN where there is none, surplus cells ignored."""
    blocks = []
    for start in range(0, len(rows), _BLOCK):
        block = rows[start : start + _BLOCK]
        try:
            if any('"' in row for row in block):
                raise ValueError("quoted cells are taken apart one by one")
            blocks.append(
                np.loadtxt(block, delimiter=separator, usecols=columns, comments=None, ndmin=2)
            )
        except ValueError:
            blocks.append(_read_one_by_one(block, separator, columns))
    return np.concatenate(blocks)


def _read_one_by_one(rows: Sequence[str], separator: str | None, columns: Sequence[int]) -> Array:
    cells = (_split_cells(row, separator) for row in rows)
    values = (to_number(row[i]) if i < len(row) else math.nan for row in cells for i in columns)
    return np.fromiter(values, np.float64).reshape(len(rows), len(columns))


def _read_motioncal(lines: Sequence[str]) -> dict[str, NDArray[Any]]:
    """The columns of MotionCal lines `Raw:ax,ay,az,gx,gy,gz,mx,my,mz`."""
    rows = [line.removeprefix(_MOTIONCAL) for line in lines]
    counts = _read_numbers(rows, ",", range(len(_MOTIONCAL_COLUMNS)))
    return {name: counts[:, k] * size for k, (name, size) in enumerate(_MOTIONCAL_COLUMNS.items())}
