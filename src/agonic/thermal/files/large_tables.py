"""Large tables of a climatic chamber: read fast where they are clean, tolerantly where not.

A clean comma-separated table goes through pyarrow, where that is installed; anything odd in it
(words among numbers, other separators) sends the file to the reader of all text tables.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.logs import parquet
from agonic.logs.formats import PARQUET, TEXT
from agonic.logs.headers.column_names import ColumnNames, names_for, rename_headers
from agonic.logs.headers.columns import find_columns, find_quantities
from agonic.logs.read import open_log
from agonic.logs.text import csv_text
from agonic.provenance import Input, hash_file
from agonic.thermal.files.split_table import Part, Table, split_table

WANTED = ("time", "date", "epoch", "field", "temperature", "station", "sensor")
"""The quantities that a campaign is about."""

_LABELS = ("sensor",)
_TIMES = ("time", "date")
_HEAD_BYTES = 65536


@dataclass(frozen=True, kw_only=True)
class RecordedFile:
    """What a file of a campaign holds, and notes on the file."""

    parts: tuple[Part, ...]
    source: Input
    notes: tuple[str, ...] = field(default_factory=tuple)


def read_recording(
    path: Path, unit: str | None = None, names: ColumnNames | None = None
) -> RecordedFile:
    """The readings in a file of a campaign, by station and sensor.

    `unit` is that of the field where no header names one, `names` what its columns are where
    headers do not say. Raises `LogError` where nothing in the file can be used.
    """
    with names_for(path, names) as given:
        return _read_named(path, unit or (None if given is None else given.unit))


def _read_named(path: Path, unit: str | None) -> RecordedFile:
    """The readings in a file whose columns have their names."""
    with path.open("rb") as stream:
        head = stream.read(_HEAD_BYTES)
    is_parquet = PARQUET.accepts(head)
    if not is_parquet and not TEXT.accepts(head):
        log = open_log(path, unit=unit)
        part = Part(station=None, sensors={samples.name: samples for samples in log.sensors})
        return RecordedFile(parts=(part,), source=log.source, notes=log.notes)
    try:
        table, notes = _read_table(path, head, is_parquet)
        source = Input(name=path.name, sha256=hash_file(path), count=len(_take_first(table)))
        parts = tuple(split_table(table, path, source, unit))
    except LogError as error:
        raise error if error.path else LogError(str(error), path=path) from error
    except Exception as error:  # parsers fail on damaged files in every way there is
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:160]
        raise LogError(f"damaged, or not what it looks like ({reason})", path=path) from error
    return RecordedFile(parts=parts, source=source, notes=notes)


def _read_table(path: Path, head: bytes, columnar: bool) -> tuple[Table, tuple[str, ...]]:
    """The wanted columns of a file, and notes."""
    if columnar:
        table, facts = parquet.read_table(path)
    else:
        quick = _read_clean_table(path, head)
        if quick is not None:
            return quick
        table, facts = csv_text.read_table(path)
    quantity = find_quantities(table)
    wanted = {header: values for header, values in table.items() if quantity[header] in WANTED}
    return wanted, facts.get("notes", ())


def _take_first(table: Table) -> NDArray[Any]:
    if not table:
        raise LogError(
            "no column of it is understood; name them time_s, mag_x_uT, temperature_C …, or say "
            "which they are: --columns time_s=…,x=…,y=…,z=…,temperature_C=… or columns in "
            "campaign.toml"
        )
    return next(iter(table.values()))


def _read_clean_table(path: Path, head: bytes) -> tuple[Table, tuple[str, ...]] | None:
    """The wanted columns of a clean comma-separated table; `None` where it is not one."""
    try:
        lines = head.decode("utf-8-sig", "strict" if len(head) < _HEAD_BYTES else "ignore")
    except UnicodeDecodeError:
        return None
    first, end, _ = lines.partition("\n")
    cells = [cell.strip() for cell in next(csv.reader([first.rstrip("\r")]), [])]
    if not end or len(cells) < 2 or first.startswith(("#", "%")):
        return None
    try:
        header = rename_headers(cells)
    except LogError:  # perhaps the cells are separated by something else
        return None
    quantity = find_quantities(header)
    wanted = {at: name for at, name in find_columns(header).items() if quantity[name] in WANTED}
    if not any(quantity[name] == "field" for name in wanted.values()):
        return None
    try:
        return _read_by_pyarrow(path, header, wanted)
    except ImportError:
        return None


def _read_by_pyarrow(
    path: Path, header: list[str], wanted: dict[int, str]
) -> tuple[Table, tuple[str, ...]] | None:
    import pyarrow as pa
    from pyarrow import csv as arrow

    short = count()

    def skip(row: Any) -> str:
        next(short)
        return "skip"

    quantity = find_quantities(header)
    numeric = {n: pa.float64() for n in wanted.values() if quantity[n] not in (*_LABELS, *_TIMES)}
    labels = {n: pa.string() for n in wanted.values() if quantity[n] in _LABELS}
    names = [wanted.get(at, f"{at}") for at in range(len(header))]
    try:
        read = arrow.read_csv(
            path,
            read_options=arrow.ReadOptions(column_names=names, skip_rows=1),
            parse_options=arrow.ParseOptions(invalid_row_handler=skip),
            convert_options=arrow.ConvertOptions(
                include_columns=list(wanted.values()), column_types={**numeric, **labels}
            ),
        )
    except pa.ArrowInvalid:
        return None
    if any(
        pa.types.is_string(read.schema.field(n).type) for n in wanted.values() if n not in labels
    ):
        return None
    table: Table = {}
    for name in read.column_names:
        column = read.column(name)
        table[name] = _decode_labels(column) if name in labels else column.to_numpy()
        read = read.drop_columns([name])  # what has been copied need not stay
    left_out = next(short)
    notes = (f"{left_out} lines with too few or too many cells were left out",) * (left_out > 0)
    return table, notes


def _decode_labels(column: Any) -> NDArray[Any]:
    """A column of labels as Python strings, each made once."""
    whole = column.combine_chunks().dictionary_encode()
    names = np.array([str(name) for name in whole.dictionary.to_pylist()], dtype=object)
    return np.asarray(names[whole.indices.fill_null(0).to_numpy(zero_copy_only=False)])
