"""Text tables: comma, semicolon, tab or blanks between the cells, with a header or without.

Understood are comments (#, %), a header in the last comment line, lines before the header and a
sampling rate in them, a row of units below it, quoted cells, three numbers in one cell and a
decimal comma. Three numbers a line without a header are a point cloud in raw units; of four, the
first a clock, it is their time. A cell that is no number becomes NaN, and `Samples` rejects and
counts the row. Lines of other kinds are those of `dialects`, `sentences`, `labels` and `brackets`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.logs.headers.column_names import rename_headers
from agonic.logs.headers.columns import find_columns, find_quantities
from agonic.logs.headers.header import identify_column, name_quantity
from agonic.logs.log import About, Facts, Log
from agonic.logs.table import build_log
from agonic.logs.text import brackets, checks, dialects, long_table, numbers
from agonic.logs.text.encoding import Text, load
from agonic.logs.text.layout import (
    LABVIEW,
    LONGEST_LINE,
    NUMBER,
    SAMPLE,
    Layout,
    Table,
    find_layout,
    is_header,
    sample_lines,
)
from agonic.provenance import Input

TableAndFacts = tuple[Table, About]
"""Columns by header, and what to say of the file."""

_HEAD = 100_000
_MOMENT = re.compile(r"(\d{4}-\d\d-\d\d[ T]|-?\d+ days )\+?\d\d:\d\d")
_LABELS = ("date", "sensor", "frame", "unit", "target")
_TEXTUAL = ("time", "latitude_deg", "longitude_deg")
_MAY_LABEL = re.compile(r"[:=]|[^\W\d]\W*[\[({<]\s*[-+.\d]")
_MARKS = ":=[({<"
"""One of which stands in every row that `_MAY_LABEL` finds; rows of numbers have none."""
_TAGGED = re.compile(r"(?:[-+.\d]+(?:\s*[,;]|\s)\s*)?\$?[A-Za-z][\w.]+(?:\s*[,;]|\s)\s*[-+.\d]")
"""A row whose first or second cell is a word before a number."""
_ASSIGNED = re.compile(
    r"[ \t]*[A-Za-z][\w \t]*(?:\[\w*\][ \t]*)*=\s*[\w.]*\(?\s*(?:[\[{(]|$)"
).match
"""A name before an array of numbers, or before the line in which that begins."""
_BRACKETED = re.compile(r"[(\[{<]\s*[-+.\d][-+.\deE,;\s]*[)\]}>]").search
_NESTED = re.compile(rb"[(\[]\s*[(\[]\s*[-+.\d]").search
_IN_NUMBERS = re.compile(r"T|(?<=[\d.])[eE](?=[-+\d])")
"""Letters of moments and of exponents."""
_THREE = re.compile(rf"[^\d+-]*({NUMBER})[^\d.+-]+({NUMBER})[^\d.+-]+({NUMBER})[^\d.]*")


class Lines(NamedTuple):
    """A text with plain rows, its first lines, those of them that hold values, and notes."""

    data: Text
    head: list[str]
    rows: list[str]
    sample: list[int]
    notes: tuple[str, ...]

    @property
    def whole(self) -> str:
        """All of it, decoded."""
        return self.data[:].decode("utf-8", "replace")


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that a text table is; `unit` is that of the field where no header names one."""
    lines = _load(path)
    if lines.head[0].startswith("# MagPy Absolutes"):
        raise LogError(
            "a sheet of absolute measurements with a theodolite, no log of a magnetometer; agonic "
            "fit north reads it"
        )
    facts = Facts(path=path, source=source, format="source text", unit=unit, notes=lines.notes)
    assigned = any(map(_ASSIGNED, lines.head[:SAMPLE])) and brackets.read_assigned(lines.data)
    if assigned:
        return build_log(assigned, **facts)
    dialect = dialects.find_dialect(lines.head, lines.rows or lines.head)
    if dialect is None and _most(lines.rows, _TAGGED.match):
        dialect = dialects.find_stated_dialect(lines.head)
    if dialect is not None:
        facts |= {"format": dialect.name, "notes": (*lines.notes, *dialect.notes)}
        tables = dialects.read_dialect(dialect, lines.whole)
        return dialects.build_kinds_log(tables, dialect.kinds, facts)
    if _most(lines.rows, lambda line: "$" in line[:40] and "," in line):
        from agonic.logs.text.sentences import read_sentences

        return read_sentences(lines.whole, facts)
    table, found = _read_lines(lines)
    facts = {**facts, **found}
    if long_table.LABEL in find_quantities(table).values():
        return long_table.build_tables_log(table, **facts)
    return build_log(table, **facts)


def read_table(path: Path) -> TableAndFacts:
    """The columns of a text table that are understood, by header, and notes on the file."""
    lines = _load(path)
    if dialect := dialects.find_dialect(lines.head, lines.rows):
        tables = dialects.read_dialect(dialect, lines.whole)
        return next(iter(tables.values())), {"format": dialect.name, "notes": lines.notes}
    return _read_lines(lines)


def _load(path: Path) -> Lines:
    """The text of a file, with plain rows for those in brackets."""
    data, notes = load(path, _count_understood)
    if _NESTED(data[:_HEAD]):
        data = brackets.unnest(data)
    head = _split_head(data)
    plain = not any(map(str.isalpha, _IN_NUMBERS.sub("", head[0])))
    if plain or head[0].startswith((LABVIEW, '"')):
        data = brackets.level(data, head)
    elif any(map(_BRACKETED, head[:SAMPLE])):
        data = brackets.open_brackets(data, head)
    head = _split_head(data)
    sample = sample_lines(head)
    return Lines(data, head, [head[i] for i in sample], sample, notes)


def _split_head(data: Text, start: int = 0) -> list[str]:
    """The first lines from a byte on, whole."""
    for size in (_HEAD, 2 * LONGEST_LINE):
        stop = len(data) if len(data) - start <= size else data.rfind(b"\n", start, start + size)
        if stop > start and (stop == len(data) or data[start:stop].count(b"\n") >= SAMPLE):
            break
    if stop < start:
        raise LogError(f"a line is longer than {LONGEST_LINE} characters: this is no table")
    return data[start:stop].decode("utf-8", "replace").split("\n")


def _count_understood(head: str) -> int:
    """How many columns of the start of a text make sense."""
    lines = head.split("\n")
    try:
        return len(find_columns(find_layout(lines, sample_lines(lines)).header))
    except (LogError, StopIteration):
        return 0


def _most(rows: Sequence[str], test: Callable[[str], object]) -> bool:
    return bool(rows) and 2 * sum(bool(test(row)) for row in rows) > len(rows)


def _read_lines(lines: Lines) -> TableAndFacts:
    """The columns of lines of one kind, and notes on them."""
    data, head, rows, _, notes = lines
    if not rows:
        raise LogError("there are no lines with values in it")
    if max(map(len, rows)) > LONGEST_LINE:
        raise LogError(f"a line is longer than {LONGEST_LINE} characters: this is no table")
    if "---" in head:
        from agonic.logs.text.labels import is_echo, read_echo

        if is_echo([line for line in head[:SAMPLE] if line.strip()]):
            from agonic.logs.text.json_text import make_table

            table, others = make_table(list(read_echo(data[:].decode().split("\n"))))
            return table, {"format": "messages of ROS as text", "others": others, "notes": notes}
    whole = "\n".join(rows)
    if any(mark in whole for mark in _MARKS) and any(map(_MAY_LABEL.search, rows)):
        from agonic.logs.text.labels import is_labelled, read_labelled

        if is_labelled(rows[1:] or rows):
            table, others = read_labelled(numbers.split_rows(data[:]))
            return table, {"format": "labelled text", "others": others, "notes": notes}
    return _read_separated(lines)


def _read_separated(lines: Lines) -> TableAndFacts:
    """The columns of cells that separators divide, and notes on them."""
    data, head, _, sample, notes = lines
    layout = find_layout(head, sample)
    notes = (*notes, *layout.notes)
    start = 0
    for _ in range(layout.start):
        start = data.find(b"\n", start) + 1 or len(data)
    cells = [layout.split(head[i]) for i in sample if i >= layout.start]
    if (channels := long_table.find_channels(layout.header, cells)) is not None:
        from agonic.logs.text.json_text import make_table

        every = map(layout.split, numbers.split_rows(data, start))
        table, others = make_table(long_table.gather_channels(channels, layout.header, every))
        return table, {"format": "long table", "others": others, "notes": notes}
    above = [line for line in head[: max(layout.start - 1, 0)] if line.strip()]
    table, others, said = _read_body(data, start, layout, "\n".join(above))
    gaps = any(np.isnan(column).any() for column in table.values() if column.dtype.kind == "f")
    if above or gaps or layout.unit or layout.rate_Hz is not None:
        table = checks.add_stated(table, layout)
        if above:
            checks.check_title(table, above)
        if head[0].startswith("GYROFLOW IMU LOG"):
            table = checks.scale_columns(table, head[1 : layout.start - 1])
        if gaps:
            checks.check_numbers(table, data, start, layout)
            table, cut = checks.cut_at_header(table, data, start, layout)
            said += cut
    return table, {"format": "text table", "others": others, "notes": (*notes, *said)}


def _read_body(
    data: Text, start: int, layout: Layout, title: str
) -> tuple[Table, list[str], tuple[str, ...]]:
    """The columns that are understood, by header, the headers of the others, and notes."""
    begun = _split_head(data, start)
    first = [layout.split(begun[i]) for i in sample_lines(begun)]
    if not first:
        raise LogError("there is a header but no row below it")
    header = rename_headers(long_table.name_label(_name_index(layout.header, first), first), title)
    stated = numbers.find_units(first, len(header))
    stated = {i: unit for i, unit in stated.items() if _agrees(header[i], unit)}
    layout = replace(layout, units=stated)
    for i, unit in stated.items():
        known = identify_column(header[i])
        if known is not None and known.unit is None:
            header[i] = f"{header[i]} ({unit})"
    vectors = _find_vectors(header, first)
    wanted = find_columns([f"{h}[0]" if i in vectors else h for i, h in enumerate(header)])
    texts = {
        i: name
        for i, name in wanted.items()
        if i in vectors or (i not in stated and _holds_texts(name, i, first))
    }
    numeric = [i for i in wanted if i not in texts]
    values = numbers.read_numbers(data, start, layout, numeric)
    coded: list[int] = []
    if np.isnan(values).any():
        coded = numbers.find_hexadecimal(first, {i: name_quantity(wanted[i]) for i in numeric})
    written = [*texts, *coded]
    found = numbers.read_texts(data, start, layout, written) if written else []
    cells = dict(zip(written, found, strict=True))
    table: Table = {}
    notes: dict[str, None] = {}
    for i, name in wanted.items():
        if i in vectors:
            table |= _take_apart(header[i], cells[i])
        elif i in texts:
            table[name] = cells[i]
        elif i in coded:
            table[name], how = numbers.read_hexadecimal(cells[i].tolist())
            notes[f"hexadecimal numbers are read as {how}"] = None
        else:
            table[name] = values[numeric.index(i)]
    return table, [h for i, h in enumerate(layout.header) if i not in wanted], tuple(notes)


def _agrees(header: str, unit: str) -> bool:
    """Whether a unit may stand in the cells of a column: its header has the same one, or none."""
    column, plain = identify_column(header), identify_column(f"mag_x ({unit})")
    if column is None or column.unit is None or column.quantity.column != "field":
        return column is not None and column.unit is None
    return plain is not None and plain.unit == column.unit


def _name_index(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """The header, with "time" for the nameless first column of a table that pandas wrote by it."""
    known = find_quantities(header).values()
    nameless = header[0] in ("", "Unnamed: 0", "index") and not {"time", "date"} & set(known)
    if nameless and _most([row[0] for row in rows if row], _MOMENT.match):
        return ["time", *header[1:]]
    return list(header)


def _find_vectors(header: Sequence[str], rows: Sequence[Sequence[str]]) -> set[int]:
    """The columns that hold three numbers a cell."""
    cells = ([row[i] for row in rows if i < len(row) and row[i]] for i in range(len(header)))
    return {
        i
        for i, (name, column) in enumerate(zip(header, cells, strict=True))
        if identify_column(f"{name}[0]") is not None and _most(column, _THREE.fullmatch)
    }


def _take_apart(name: str, cells: NDArray[Any]) -> Table:
    """The three columns of a column of vectors; a cell that is none becomes NaN."""
    found = (_THREE.fullmatch(cell) for cell in cells)
    values = np.array([m.groups() if m else (np.nan,) * 3 for m in found], dtype=np.float64)
    return {f"{name}[{k}]": values[:, k] for k in range(3)}


def _holds_texts(name: str, at: int, rows: Sequence[Sequence[str]]) -> bool:
    """Whether a column may hold texts and most of its first cells do; a label is always one."""
    quantity = name_quantity(name)
    words = quantity in _TEXTUAL and is_header([cell for row in rows for cell in row[at : at + 1]])
    return words or quantity in _LABELS
