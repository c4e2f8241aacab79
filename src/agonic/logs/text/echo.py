"""Messages as `rostopic echo` and `ros2 topic echo` print them: YAML, with `---` between them.

Names within names are joined by dots (`magnetic_field.x`); lists are left, but those of three
numbers. A message that is cut off by the next one is kept as far as it goes.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

_LINE = re.compile(r"(?P<indent> *)(?P<key>[^\W\d]\w*):(?: +(?P<value>.*))?")
_ITEM = re.compile(r" *- ?.*")
_BETWEEN = ("---", "...")
_MOST_WITHIN = 8


def is_echo(rows: Sequence[str]) -> bool:
    """Whether lines are such messages: names alone, values below them, and a mark between.

    >>> is_echo(["header:", "  seq: 1", "magnetic_field:", "  x: 1.0e-05", "---"])
    True
    """
    plain = [row.rstrip() for row in rows]
    opened = any((line := _LINE.fullmatch(row)) and not line["value"] for row in plain)
    known = (row in _BETWEEN or _LINE.fullmatch(row) or _ITEM.fullmatch(row) for row in plain)
    return "---" in plain and opened and all(known)


def read_echo(rows: Iterable[str]) -> Iterator[dict[str, object]]:
    """The values of each message by dotted names.

    >>> list(read_echo(["a:", "  x: 1", "  y: [1, 2, 3]", "---", "a:", "  x: 2"]))
    [{'a.x': '1', 'a.y': ['1', '2', '3']}, {'a.x': '2'}]
    """
    message: dict[str, object] = {}
    within: list[tuple[int, str]] = []
    for row in rows:
        if row.rstrip() in _BETWEEN:
            if message:
                yield message
            message, within = {}, []
            continue
        line = _LINE.fullmatch(row.rstrip())
        if line is None:
            continue
        indent = len(line["indent"])
        while within and within[-1][0] >= indent:
            within.pop()
        value = (line["value"] or "").strip()
        if not value:
            within = [*within, (indent, line["key"])][:_MOST_WITHIN]
            continue
        name = ".".join([*(key for _, key in within), line["key"]])
        message[name] = _read_list(value) if value.startswith("[") else value.strip("\"'")
    if message:
        yield message


def _read_list(value: str) -> list[str]:
    return [cell.strip() for cell in value[:1000].strip("[] ").split(",")]
