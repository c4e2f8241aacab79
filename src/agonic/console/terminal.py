"""How wide the terminal is, and signs that one without Unicode does not have, in ASCII."""

from __future__ import annotations

import codecs
import os
import sys
from io import TextIOWrapper
from typing import Any


def find_width() -> int:
    """Columns to write in: those of `COLUMNS`, else of the terminal, else a hundred; 40 to 200."""
    told = os.environ.get("COLUMNS", "")
    width = int(told) if told.isdecimal() else 0
    if not width and sys.stdout.isatty():
        width = os.get_terminal_size(sys.stdout.fileno()).columns
    return min(max(width or 100, 40), 200)  # 100 into a file or a pipe


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
    """What stands for signs that cannot be encoded."""
    assert isinstance(error, UnicodeEncodeError)
    signs = error.object[error.start : error.end]
    return "".join(_ASCII.get(sign, ascii(sign)[1:-1]) for sign in signs), error.end
