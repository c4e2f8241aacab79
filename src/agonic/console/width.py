"""How wide the terminal is."""

from __future__ import annotations

import os
import sys

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
