"""`-` for a recording: what comes by standard input."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from agonic.errors import LogError

NAME = "standard-input"
"""What the file is called in which it is kept while a command runs."""
_NO_INPUT = ("-o", "--out", "--report", "--live", "--stars")
"""Options after which - is no recording: what is written, and what is read as it comes."""


@contextmanager
def keep_standard_input(arguments: Sequence[str]) -> Iterator[list[str]]:
    """The arguments, with a file of what was piped in for the first that is a lone `-`."""
    before = ["", *arguments]
    if any(word == "" and not before[k].startswith("-") for k, word in enumerate(arguments)):
        raise LogError("an empty name was given: name the file, or . for this folder")
    asked = [k for k, word in enumerate(arguments) if word == "-" and before[k] not in _NO_INPUT]
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
