"""JSON: an object a line, a list of objects, or lists of numbers by name; see `records`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.logs.contents import DEEPEST, MOST_BYTES
from agonic.logs.formats import decode_marked
from agonic.logs.groups import Found
from agonic.logs.headers.column_names import number_columns
from agonic.logs.text.dialects import Cell, Kind, find_group, name_cells
from agonic.logs.text.records import Record, are_objects, make_table

_NO_NUMBER = re.compile(rb"(?<=[\[:,\s])[-+]?(?:NaN|nan|Infinity|inf)(?=\s*[,\]}])")
"""What Python's own writer puts for numbers that are none."""
_PRINTED = re.compile(rb"\s*[\[(]?\s*\{\s*'")
_CALL = re.compile(rb"[a-z][\w.]*\(([^()]*)\)")  # array([1.0, 2.0]), np.float64(3.0)
_FROM_PYTHON = bytes.maketrans(b"'()", b'"[]')
"""How Python prints what JSON writes otherwise: {'mag': (1.0, 2.0, 3.0)}."""


def read_tables(path: Path) -> Found:
    """The columns that are understood of a JSON text, by name, and notes on it."""
    records, broken = _load_file(path)
    if messages := _gather_messages(records):
        corrected = {name: kind.corrected for name, kind in find_group("MAVLink").items()}
        return Found(messages, {"format": "MAVLink as JSON"}, corrected)
    table, others = make_table(records)
    notes = (f"{broken} lines or an incomplete end are not JSON and were left out",) * (broken > 0)
    return Found({"": table}, {"format": "JSON", "others": others, "notes": notes})


def _gather_messages(records: list[Record]) -> dict[str, dict[str, NDArray[Any]]]:
    """The columns of MAVLink messages as `mavlogdump.py --format json` writes them, at the times of
    their arrival; none where the objects are others."""
    known = find_group("MAVLink")
    found: dict[str, list[Record]] = {}
    for record in records:
        meta, data = record.get("meta"), record.get("data")
        if isinstance(meta, dict) and isinstance(data, dict) and meta.get("type") in known:
            found.setdefault(meta["type"], []).append({**data, "arrived": meta.get("timestamp")})
    tables = {}
    for kind, rows in found.items():
        cells = tuple(c for c in known[kind].cells if not c.header.startswith("time"))
        tables[kind] = name_cells(Kind((Cell("time_s", theirs="arrived"), *cells)), rows)
    return tables if any("mag_x_mG" in table for table in tables.values()) else {}


def _load_file(path: Path) -> tuple[list[Record], int]:
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


def _load_lines(data: bytes) -> tuple[list[Record], int]:
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


def _spread(records: list[Record]) -> list[Record]:
    """The objects in a list that each object holds, as phones send them; else the objects."""
    first = records[0] if records else {}
    name = next((n for n, v in first.items() if isinstance(v, list) and v and are_objects(v)), "")
    if not name:
        return records
    spread = []
    for record in records:
        inner = record.get(name)
        beside = {n: v for n, v in record.items() if not isinstance(v, list | dict)}
        for one in inner if isinstance(inner, list) and are_objects(inner) else ():
            values = one.get("values")
            named = {"sensor" if n == "name" else n: v for n, v in one.items() if n != "values"}
            spread.append(beside | (named | values if isinstance(values, dict) else one))
    return spread


def _load_line(line: bytes) -> Any:
    """The value in a line; also where a program in Python has printed it, with single quotes."""
    for text in (line, line.replace(b"'", b'"').replace(b"None", b"null")):
        with suppress(msgspec.DecodeError, UnicodeDecodeError, RecursionError):
            return msgspec.json.decode(text)
    return None


def _find_records(whole: Any, depth: int = 0) -> list[Record]:
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
    longest: list[Record] = []
    for value in whole.values():
        if isinstance(value, dict | list) and value:
            with suppress(LogError):
                longest = max(longest, _find_records(value, depth + 1), key=len)
    return longest or [whole]


def _name_rows(rows: list[Any], names: Sequence[str] | None) -> list[Record]:
    """Rows that are lists of one length, by the names of their columns; three alone are x, y, z."""
    widths = {len(row) if isinstance(row, list) else 0 for row in rows}
    width = widths.pop() if len(widths) == 1 else 0
    if names is None:
        names = "xyz" if width == 3 else number_columns(width)
    if not width or names is None or len(names) != width:
        return []
    return [dict(zip(names, row, strict=True)) for row in rows]


def _read_columns(whole: Mapping[str, Any]) -> list[Record]:
    """Rows of columns that are objects with the same keys, as pandas writes them; else none."""
    columns = {name: value for name, value in whole.items() if isinstance(value, dict)}
    keys = [list(column) for column in columns.values()]
    if len(columns) != len(whole) or len(keys[0]) <= 3 or any(k != keys[0] for k in keys):
        return []
    return [{name: column[key] for name, column in columns.items()} for key in keys[0]]
