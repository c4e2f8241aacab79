"""How wide the terminal is, and signs that one without Unicode does not have, in ASCII."""

from __future__ import annotations

import codecs
import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import TextIOWrapper
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from agonic.errors import LogError

NARROWEST, WIDEST = 40, 200
NOWHERE = 100
"""Columns where nobody says how many there are: output that goes into a file or a pipe."""


def find_width() -> int:
    """Columns to write in: those of `COLUMNS`, else of the terminal, else a hundred; 40 to 200."""
    told = os.environ.get("COLUMNS", "")
    width = int(told) if told.isdecimal() else 0
    if not width and sys.stdout.isatty():
        width = os.get_terminal_size(sys.stdout.fileno()).columns
    return min(max(width or NOWHERE, NARROWEST), WIDEST)


_ASCII = {
    "\N{MINUS SIGN}": "-",
    "\N{EN DASH}": "-",
    "\N{NO-BREAK SPACE}": " ",
    "\N{NARROW NO-BREAK SPACE}": " ",
    "°": " deg",
    "±": "+-",
    "µ": "u",
    "σ": "sd",
    "χ": "chi",
    "→": "->",
    "…": "...",
    "·": "*",
    "²": "^2",
    "√": "sqrt ",
    "“": '"',
    "”": '"',
    "\N{RIGHT SINGLE QUOTATION MARK}": "'",
    "′": "'",
    "″": '"',
    "✓": "+",
    "✗": "x",
}


def allow_any_sign(stream: Any) -> None:
    """Let a stream that is not UTF-8 print every sign: in ASCII, or by its number."""
    if isinstance(stream, TextIOWrapper):
        codecs.register_error("agonic", _transliterate)
        stream.reconfigure(errors="agonic")


def _transliterate(error: UnicodeError) -> tuple[str, int]:
    """What stands for signs that cannot be encoded.

    >>> _transliterate(UnicodeEncodeError("ascii", "−66° \N{BULLET}", 3, 6, "not ASCII"))
    (' deg \\\\u2022', 6)
    """
    assert isinstance(error, UnicodeEncodeError)
    signs = error.object[error.start : error.end]
    return "".join(_ASCII.get(sign, ascii(sign)[1:-1]) for sign in signs), error.end


NAME = "standard-input"
"""What the file is called in which it is kept while a command runs."""
_OUTPUTS = ("-o", "--out", "--report")


@contextmanager
def keep_standard_input(arguments: Sequence[str]) -> Iterator[list[str]]:
    """The arguments, with a file of what was piped in for the first that is a lone `-`.

    >>> with keep_standard_input(["info", "log.csv"]) as same:
    ...     same
    ['info', 'log.csv']
    """
    before = ["", *arguments]
    if any(word == "" and not before[k].startswith("-") for k, word in enumerate(arguments)):
        raise LogError("an empty name was given: name the file, or . for this folder")
    asked = [k for k, word in enumerate(arguments) if word == "-" and before[k] not in _OUTPUTS]
    if not asked:
        yield list(arguments)
        return
    if sys.stdin is None or sys.stdin.isatty():
        raise LogError("- is what is piped into the command, and nothing is: give a file, or | it")
    with TemporaryDirectory(prefix="agonic-") as folder:
        file = Path(folder, NAME)
        with file.open("wb") as kept:
            shutil.copyfileobj(sys.stdin.buffer, kept)
        yield [str(file) if k == asked[0] else word for k, word in enumerate(arguments)]
