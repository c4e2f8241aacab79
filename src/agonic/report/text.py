"""Plain text for a terminal: the signs of verdicts, wrapped lines, entries with labels, tables."""

from __future__ import annotations

import textwrap
import unicodedata
from collections.abc import Mapping, Sequence

from agonic.report.digits import typeset

WIDTH = 100
SIGNS = {"good": "✓", "check": "!", "refused": "✗"}
"""The sign of each verdict at the head of a line."""


def wrap(text: str, *, width: int = WIDTH, indent: str = "  ", label: str = "") -> str:
    """Text as lines of a terminal's width; a label stands before the first."""
    return textwrap.fill(
        typeset(printable(text)),
        width,
        initial_indent=indent + label,
        subsequent_indent=indent + " " * len(label),
        break_long_words=False,
        break_on_hyphens=False,
    )


def wrap_command(command: str, *, width: int = WIDTH, label: str = "") -> str:
    """A command to type, which goes on after a backslash where it is too long for a line."""
    lines = textwrap.wrap(
        printable(command),
        width - 2,
        initial_indent=label,
        subsequent_indent=" " * len(label),
        break_long_words=False,
        break_on_hyphens=False,
    )
    return " \\\n".join(lines)


def wrap_entries(entries: Mapping[str, str], *, width: int = WIDTH, least: int = 0) -> list[str]:
    """Each entry on as many lines as it takes, its label before it, `least` characters wide. Lines
    of an entry stay lines."""
    wide = max(least, *map(len, entries), 0) + 2
    return [
        wrap(line, width=width, label=f"{'' if k else label:<{wide}}")
        for label, text in entries.items()
        if text
        for k, line in enumerate(text.split("\n"))
    ]


def format_columns(
    head: Sequence[str], rows: Sequence[Sequence[str]], width: int = WIDTH
) -> list[str]:
    """A table as lines: names in the first column from the left, all else from the right.

    Columns without an entry, which are there to be filled in on paper, are left out. In a table
    that is wider than `width` heads and names go over several lines; one that still is becomes a
    few lines for each row.
    """
    kept = [k for k in range(len(head)) if any(row[k] for row in rows)]
    table = [[row[k] for k in kept] for row in (head, *rows)]
    wide = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = _lay_out(table, wide)
    if max(map(len, lines)) <= width:
        return lines
    wide = [
        max(*map(len, name.split()), *map(len, cells)) for name, *cells in zip(*table, strict=True)
    ]
    room = width - sum(wide[1:]) - 2 * len(wide)
    if room >= min(wide[0], 12):
        return _lay_out(table, [min(wide[0], room), *wide[1:]])
    names, *values = table
    lines = []
    for first, *others in values:
        named = {f"  {name}": value for name, value in zip(names[1:], others, strict=True)}
        lines += [f"  {first}", *wrap_entries(named, width=width)]
    return lines


def _lay_out(table: Sequence[Sequence[str]], wide: Sequence[int]) -> list[str]:
    """The rows of a table, the first its head, in columns so wide; long cells go over lines."""
    numbered = all(row[0].isdecimal() for row in table[1:])
    lines = []
    for k, row in enumerate(table):
        parts = [
            textwrap.wrap(cell, w, subsequent_indent="  " * (k > 0)) or [""]
            for cell, w in zip(row, wide, strict=True)
        ]
        depth = max(map(len, parts))
        for at in range(depth):
            cells = []
            for column, (part, w) in enumerate(zip(parts, wide, strict=True)):
                line = at - (depth - len(part) if k == 0 else 0)  # heads stand on their columns
                text = part[line] if 0 <= line < len(part) else ""
                cells.append(text.rjust(w) if column or numbered else text.ljust(w))
            lines.append(f"  {'  '.join(cells)}".rstrip())
    return lines


def printable(text: str) -> str:
    """Text without the control characters that a log could smuggle into a terminal."""
    kept = (c if c.isprintable() or unicodedata.category(c) == "Zs" else "?" for c in text)
    return "".join(kept)
