"""Plain text for a terminal: the signs of verdicts, wrapped lines, entries with labels, tables."""

from __future__ import annotations

import textwrap
import unicodedata
from collections.abc import Mapping, Sequence

from agonic.report.digits import write_minus

WIDTH = 100
SIGNS = {"good": "✓", "check": "!", "refused": "✗"}
"""The sign of each verdict at the head of a line."""


def wrap(text: str, *, indent: str = "  ", label: str = "", most_lines: int | None = None) -> str:
    """Text as lines of a terminal's width; a label stands before the first.

    Parameters
    ----------
    indent : before every line. label : before the first; the other lines begin where it ends.
    most_lines : of which the last ends in an ellipsis where the text is longer.

    >>> print(wrap("turn it about all the axes " * 5, label="Next  "))
      Next  turn it about all the axes turn it about all the axes turn it about all the axes turn it
            about all the axes turn it about all the axes
    """
    return textwrap.fill(
        write_minus(printable(text)),
        WIDTH,
        initial_indent=indent + label,
        subsequent_indent=indent + " " * len(label),
        break_long_words=False,
        max_lines=most_lines,
        placeholder=" …",
    )


def wrap_entries(
    entries: Mapping[str, str], *, least: int = 0, most_lines: int | None = None
) -> list[str]:
    """Each entry on as many lines as it takes, its label before it, `least` characters wide.

    >>> wrap_entries({"Noise": "12 nT", "Condition": "3.1"})
    ['  Noise      12 nT', '  Condition  3.1']
    """
    wide = max(least, *map(len, entries), 0) + 2
    return [
        wrap(text, label=f"{label:<{wide}}", most_lines=most_lines)
        for label, text in entries.items()
        if text
    ]


def format_columns(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """A table as lines: names in the first column from the left, all else from the right.

    Columns without an entry, which are there to be filled in on paper, are left out.

    >>> format_columns(["nodes", "rms, nT"], [["3", "12.5"], ["10", "9.1"]])
    ['  nodes  rms, nT', '      3     12.5', '     10      9.1']
    """
    kept = [k for k in range(len(head)) if any(row[k] for row in rows)]
    table = [[row[k] for k in kept] for row in (head, *rows)]
    wide = [max(map(len, column)) for column in zip(*table, strict=True)]
    numbered = all(row[0].isdecimal() for row in table[1:])
    lines = []
    for first, *others in table:
        cells = [first.rjust(wide[0]) if numbered else first.ljust(wide[0])]
        cells += [cell.rjust(w) for cell, w in zip(others, wide[1:], strict=True)]
        lines.append(f"  {'  '.join(cells)}".rstrip())
    return lines


def printable(text: str) -> str:
    """Text without the control characters that a log could smuggle into a terminal.

    >>> printable("a\\x07b"), printable("1\u202fnT") == "1\u202fnT"
    ('a?b', True)
    """
    kept = (c if c.isprintable() or unicodedata.category(c) == "Zs" else "?" for c in text)
    return "".join(kept)
