"""Signs that a terminal without Unicode does not have, in ASCII."""

from __future__ import annotations

import codecs
from io import TextIOWrapper
from typing import Any

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
