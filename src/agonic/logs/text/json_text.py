"""JSON: an object a line, a list of objects, or lists of numbers by name.

Names within names are joined by dots (`mag.x`), a list of three numbers is a vector (`mag[0]`), and
numbers may be written as texts. Otherwise columns are named as those of a text table are.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.logs.contents import DEEPEST, MOST_BYTES
from agonic.logs.formats import decode_marked
from agonic.logs.headers.column_names import number_columns, rename_headers
from agonic.logs.headers.columns import find_columns, find_quantities, refuse_many
from agonic.logs.log import About, Facts, Log
from agonic.logs.text.dialects import Cell, Kind, build_kinds_log, find_group, name_cells
from agonic.logs.text.layout import SAMPLE
from agonic.logs.text.long_table import build_tables_log, name_label
from agonic.provenance import Input

TEXTUAL = ("time", "date", "sensor", "frame", "unit", "target")
_NO_NUMBER = re.compile(rb"(?<=[\[:,\s])[-+]?(?:NaN|nan|Infinity|inf)(?=\s*[,\]}])")
"""What Python's own writer puts for numbers that are none."""
_PRINTED = re.compile(rb"\s*[\[(]?\s*\{\s*'")
_CALL = re.compile(rb"[a-z][\w.]*\(([^()]*)\)")  # array([1.0, 2.0]), np.float64(3.0)
_FROM_PYTHON = bytes.maketrans(b"'()", b'"[]')
"""How Python prints what JSON writes otherwise: {'mag': (1.0, 2.0, 3.0)}."""


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that a JSON text is; `unit` is that of the field where no name tells one."""
    records, broken = _load_file(path)
    facts = Facts(path=path, source=source, format="MAVLink as JSON", unit=unit)
    if messages := _gather_messages(records):
        return build_kinds_log(messages, find_group("MAVLink"), facts)
    table, found = _make_table(records, broken)
    return build_tables_log(table, path=path, source=source, unit=unit, **found)


def _gather_messages(records: list[dict[str, Any]]) -> dict[str, dict[str, NDArray[Any]]]:
    """The columns of MAVLink messages as `mavlogdump.py --format json` writes them, at the times of
    their arrival; none where the objects are others."""
    known = find_group("MAVLink")
    found: dict[str, list[dict[str, Any]]] = {}
    for record in records:
        meta, data = record.get("meta"), record.get("data")
        if isinstance(meta, dict) and isinstance(data, dict) and meta.get("type") in known:
            found.setdefault(meta["type"], []).append({**data, "arrived": meta.get("timestamp")})
    tables = {}
    for kind, rows in found.items():
        cells = tuple(c for c in known[kind].cells if not c.header.startswith("time"))
        tables[kind] = name_cells(Kind((Cell("time_s", theirs="arrived"), *cells)), rows)
    return tables if any("mag_x_mG" in table for table in tables.values()) else {}


def read_table(path: Path) -> tuple[dict[str, NDArray[Any]], About]:
    """The columns that are understood, by name, and notes on the file."""
    return _make_table(*_load_file(path))


def _make_table(
    records: list[dict[str, Any]], broken: int
) -> tuple[dict[str, NDArray[Any]], About]:
    table, others = make_table(records)
    notes = (f"{broken} lines or an incomplete end are not JSON and were left out",) * (broken > 0)
    return table, {"format": "JSON", "others": others, "notes": notes}


def make_table(records: list[dict[str, Any]]) -> tuple[dict[str, NDArray[Any]], list[str]]:
    """The columns of objects that are understood, by name, and the names of the others."""
    columns = _make_columns(records)
    names = list(columns)
    texts = [[v if isinstance(v, str) else "" for v in columns[name][:SAMPLE]] for name in names]
    wanted = find_columns(rename_headers(name_label(names, list(zip(*texts, strict=True)))))
    quantities = find_quantities(wanted.values())
    table = {
        name: to_column(columns[names[i]], textual=quantities[name] in TEXTUAL)
        for i, name in wanted.items()
    }
    return table, [name for i, name in enumerate(names) if i not in wanted]


def _load_file(path: Path) -> tuple[list[dict[str, Any]], int]:
    """The objects in a text, and how many of its lines are none."""
    if path.stat().st_size > 2 * MOST_BYTES:
        raise LogError("a JSON text of this size is no log that fits in memory; write a CSV table")
    data = decode_marked(path.read_bytes())
    if _PRINTED.match(data):
        data = _CALL.sub(rb"\1", data).translate(_FROM_PYTHON)
        for theirs, ours in ((b"None", b"null"), (b"True", b"true"), (b"False", b"false")):
            data = data.replace(theirs, ours)
    for text in (data, _NO_NUMBER.sub(b"null", data)):
        try:
            return _find_records(msgspec.json.decode(text)), 0
        except (msgspec.DecodeError, UnicodeDecodeError):
            continue
        except RecursionError:
            raise LogError("nested too deeply for a log") from None
    return _load_lines(text)


def _load_lines(data: bytes) -> tuple[list[dict[str, Any]], int]:
    found = [_load_line(line) for line in data.splitlines() if line.strip()]
    records = [record for record in found if isinstance(record, dict)]
    broken = len(found) - len(records)
    if broken > len(records):
        try:
            return _find_records(msgspec.json.decode(_close_brackets(data))), 1
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            raise LogError(
                "damaged JSON, or none: most of its lines are no objects; fetch it again"
            ) from None
    return _spread(records), broken


_BRACKET = re.compile(rb'"(?:[^"\\]|\\.)*"|[\[\]{}]')


def _close_brackets(data: bytes) -> bytes:
    """A text that ends in the middle, as far as its objects are whole; empty where that is none."""
    opened: list[bytes] = []
    whole, left = 0, b""
    for match in _BRACKET.finditer(data):
        if match[0] in b"[{":
            opened.append(b"]" if match[0] == b"[" else b"}")
        elif len(match[0]) == 1:
            if not opened or opened.pop() != match[0]:
                return b""
            if match[0] == b"}" and opened[-1:] == [b"]"]:  # an object of a list
                whole, left = match.end(), b"".join(reversed(opened))
    return data[:whole] + left


def _spread(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The objects in a list that each object holds, as phones send them; else the objects."""
    first = records[0] if records else {}
    name = next((n for n, v in first.items() if isinstance(v, list) and v and _are_objects(v)), "")
    if not name:
        return records
    spread = []
    for record in records:
        inner = record.get(name)
        beside = {n: v for n, v in record.items() if not isinstance(v, list | dict)}
        for one in inner if isinstance(inner, list) and _are_objects(inner) else ():
            values = one.get("values")
            named = {"sensor" if n == "name" else n: v for n, v in one.items() if n != "values"}
            spread.append(beside | (named | values if isinstance(values, dict) else one))
    return spread


def _are_objects(values: list[Any]) -> bool:
    return all(isinstance(value, dict) for value in values)


def _load_line(line: bytes) -> Any:
    """The value in a line; also where a program in Python has printed it, with single quotes."""
    for text in (line, line.replace(b"'", b'"').replace(b"None", b"null")):
        with suppress(msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return msgspec.json.decode(text)
    return None


def _find_records(whole: Any, depth: int = 0) -> list[dict[str, Any]]:
    """The list of objects that a value is, or the longest one in it; lists by name as objects."""
    if isinstance(whole, list):
        return [one for one in whole if isinstance(one, dict)] or _name_rows(whole, None)
    if not isinstance(whole, dict) or depth > DEEPEST:
        raise LogError("this JSON holds no list of objects and no lists of numbers")
    if isinstance(names := whole.get("columns"), list) and isinstance(whole.get("data"), list):
        return _name_rows(whole["data"], [str(name) for name in names])
    if len(whole) >= 3 and (columns := _read_columns(whole)):
        return columns
    lists = {name: v for name, v in whole.items() if isinstance(v, list) and len(v) > 3}
    plain = {name: v for name, v in lists.items() if not isinstance(v[0], dict)}
    if len(plain) >= 3:
        length = max(map(len, plain.values()))
        same = {name: v for name, v in plain.items() if len(v) == length}
        return [dict(zip(same, row, strict=True)) for row in zip(*same.values(), strict=True)]
    longest: list[dict[str, Any]] = []
    for value in whole.values():
        if isinstance(value, dict | list) and value:
            with suppress(LogError):
                longest = max(longest, _find_records(value, depth + 1), key=len)
    return longest or [whole]


def _name_rows(rows: list[Any], names: Sequence[str] | None) -> list[dict[str, Any]]:
    """Rows that are lists of one length, by the names of their columns; three alone are x, y, z."""
    widths = {len(row) if isinstance(row, list) else 0 for row in rows}
    width = widths.pop() if len(widths) == 1 else 0
    if names is None:
        names = "xyz" if width == 3 else number_columns(width)
    if not width or names is None or len(names) != width:
        return []
    return [dict(zip(names, row, strict=True)) for row in rows]


def _read_columns(whole: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Rows of columns that are objects with the same keys, as pandas writes them; else none."""
    columns = {name: value for name, value in whole.items() if isinstance(value, dict)}
    keys = [list(column) for column in columns.values()]
    if len(columns) != len(whole) or len(keys[0]) <= 3 or any(k != keys[0] for k in keys):
        return []
    return [{name: column[key] for name, column in columns.items()} for key in keys[0]]


def _make_columns(records: list[dict[str, Any]]) -> dict[str, list[Any]]:
    """Lists of one length by name; `None` where a record lacks it."""
    rows = [one for record in records for one in _unpack(record)]
    names: dict[str, None] = {}
    for row in rows:
        names |= dict.fromkeys(row)
        refuse_many(len(names), "names")
    return {name: [row.get(name) for row in rows] for name in names}


def _unpack(record: dict[str, Any]) -> list[dict[str, Any]]:
    """The values of an object by dotted names, of a list of three or four by [0], [1], …; a packet
    of several readings, whose lists of objects have one length, as so many records."""
    flat = list(_flatten(record))
    lists = {name: v for name, v in flat if isinstance(v, list) and v and _are_objects(v)}
    count = {len(values) for values in lists.values()}
    if len(count) != 1:
        return [dict(_number_parts(flat))]
    taken = (
        [part for n, v in flat for part in (_flatten(v[k], f"{n}.") if n in lists else [(n, v)])]
        for k in range(count.pop())
    )
    return [dict(_number_parts(parts)) for parts in taken]


def _flatten(
    record: Mapping[str, Any], before: str = "", depth: int = 0
) -> Iterator[tuple[str, Any]]:
    """The values of an object by dotted names."""
    for key, value in record.items():
        if not isinstance(value, dict):
            yield f"{before}{key}", value
        elif depth < DEEPEST:
            yield from _flatten(value, f"{before}{key}.", depth + 1)


def _number_parts(values: Iterable[tuple[str, Any]]) -> Iterator[tuple[str, Any]]:
    """The values, of a list of three or four by [0], [1], …, without other lists."""
    for name, value in values:
        if not isinstance(value, list):
            yield name, value
        elif len(value) in (3, 4):
            yield from ((f"{name}[{k}]", one) for k, one in enumerate(value))


def to_column(column: list[Any], *, textual: bool) -> NDArray[Any]:
    """A column as numbers; as texts where it may hold such and does."""
    numbers = np.array([_number(value) for value in column], dtype=np.float64)
    known = sum(value is not None for value in column)
    if textual and 2 * np.isfinite(numbers).sum() < known:
        return np.array(["" if v is None else str(v) for v in column], dtype=object)
    return numbers


def _number(value: Any) -> float:
    with suppress(OverflowError, ValueError):
        return float(value) if isinstance(value, int | float | str) else np.nan
    return np.nan
