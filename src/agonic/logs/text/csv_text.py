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
from agonic.logs.groups import Found, name_label
from agonic.logs.headers.column_names import rename_headers
from agonic.logs.headers.columns import find_columns, find_quantities
from agonic.logs.headers.header import identify_column, name_quantity
from agonic.logs.log import About
from agonic.logs.text import brackets, checks, dialects, numbers
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


def read_tables(path: Path) -> Found:
    """The tables of a text: of the first of the forms that it has."""
    lines = _load(path)
    if lines.head[0].startswith("# MagPy Absolutes"):
        raise LogError(
            "a sheet of absolute measurements with a theodolite, no log of a magnetometer; agonic "
            "fit north reads it"
        )
    forms = (_read_arrays, _read_dialect, _read_sentences, _read_echo, _read_labelled)
    found = next((found for form in forms if (found := form(lines))), None)
    found = found or _read_separated(lines)
    about: About = {**found.about, "notes": (*lines.notes, *found.about.get("notes", ()))}
    return found._replace(about=about)


def read_table(path: Path) -> TableAndFacts:
    """The columns of a text table that are understood, by header, and notes on the file."""
    found = read_tables(path)
    return dict(next(iter(found.tables.values()))), found.about


def _read_arrays(lines: Lines) -> Found | None:
    """Arrays of source text."""
    if not any(map(_ASSIGNED, lines.head[:SAMPLE])):
        return None
    table = brackets.read_assigned(lines.data)
    return Found({"": table}, {"format": "source text"}) if table else None


def _read_dialect(lines: Lines) -> Found | None:
    """Rows whose layout is documented, or stated in the first lines, or named for sensors."""
    rows = lines.rows or lines.head
    dialect = next((one for one in dialects.list_dialects() if one.fits(lines.head, rows)), None)
    if dialect is None and _most(lines.rows, _TAGGED.match):
        dialect = dialects.find_stated_dialect(lines.head)
    return dialects.read_dialect(dialect, lines.whole) if dialect else None


def _read_sentences(lines: Lines) -> Found | None:
    """Sentences with a checksum, or without."""
    if not _most(lines.rows, lambda line: "$" in line[:40] and "," in line):
        return None
    from agonic.logs.text.sentences import read_sentences

    return read_sentences(lines.whole)


def _read_echo(lines: Lines) -> Found | None:
    """Messages of ROS with `---` between them."""
    if "---" not in lines.head:
        return None
    from agonic.logs.text.labels import is_echo, read_echo

    if not is_echo([line for line in lines.head[:SAMPLE] if line.strip()]):
        return None
    from agonic.logs.text.records import make_table

    table, others = make_table(list(read_echo(lines.data[:].decode().split("\n"))))
    return Found({"": table}, {"format": "messages of ROS as text", "others": others})


def _read_labelled(lines: Lines) -> Found | None:
    """Lines that name their numbers."""
    if not lines.rows:
        raise LogError("there are no lines with values in it")
    if max(map(len, lines.rows)) > LONGEST_LINE:
        raise LogError(f"a line is longer than {LONGEST_LINE} characters: this is no table")
    whole = "\n".join(lines.rows)
    if not any(mark in whole for mark in _MARKS) or not any(map(_MAY_LABEL.search, lines.rows)):
        return None
    from agonic.logs.text.labels import is_labelled, read_labelled

    if not is_labelled(lines.rows[1:] or lines.rows):
        return None
    table, others = read_labelled(numbers.split_rows(lines.data[:]))
    return Found({"": table}, {"format": "labelled text", "others": others})


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


def _read_separated(lines: Lines) -> Found:
    """The columns of cells that separators divide, and notes on them."""
    data, head, sample = lines.data, lines.head, lines.sample
    layout = find_layout(head, sample)
    start = 0
    for _ in range(layout.start):
        start = data.find(b"\n", start) + 1 or len(data)
    cells = [layout.split(head[i]) for i in sample if i >= layout.start]
    from agonic.logs.text.records import find_channels, make_table

    if (channels := find_channels(layout.header, cells)) is not None:
        every = map(layout.split, numbers.split_rows(data, start))
        table, others = make_table(channels.read(layout.header, every))
        about: About = {"format": "long table", "others": others, "notes": layout.notes}
        return Found({"": table}, about)
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
    notes = (*layout.notes, *said)
    return Found({"": table}, {"format": "text table", "others": others, "notes": notes})


def _read_body(
    data: Text, start: int, layout: Layout, title: str
) -> tuple[Table, list[str], tuple[str, ...]]:
    """The columns that are understood, by header, the headers of the others, and notes."""
    begun = _split_head(data, start)
    first = [layout.split(begun[i]) for i in sample_lines(begun)]
    if not first:
        raise LogError("there is a header but no row below it")
    header = rename_headers(name_label(_name_index(layout.header, first), first), title)
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
