"""Walking through the XML of a workbook piece by piece, without a tree in memory."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from typing import IO, Any, NoReturn
from xml.parsers import expat

from agonic.errors import LogError

Start = Callable[[str, Mapping[str, str]], None]
End = Callable[[str], None]
Text = Callable[[str], None]

LONGEST_TEXT = 32_767
"""Letters of a cell; a spreadsheet has no more."""
_PIECE = 1 << 16
_LONGEST_S = 60.0


def scan(stream: IO[bytes], start: Start, end: End, text: Text) -> Iterator[None]:
    """Call the handlers for elements and text, names without their prefix, a pause a piece.

    Declarations of a document type, and with them entities, are refused: no workbook has them.
    """
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartDoctypeDeclHandler = _refuse
    parser.StartElementHandler = lambda name, given: start(_plain(name), given)
    parser.EndElementHandler = lambda name: end(_plain(name))
    parser.CharacterDataHandler = text
    end_s = time.monotonic() + _LONGEST_S
    while piece := stream.read(_PIECE):
        parser.Parse(piece)
        if time.monotonic() > end_s:
            raise LogError(f"reading a sheet takes more than {_LONGEST_S:g} s; save it as CSV")
        yield
    parser.Parse(b"", True)
    yield


def _plain(name: str) -> str:
    return name.rpartition(":")[2]


def _refuse(*_: Any) -> NoReturn:
    raise LogError("its XML declares a document type, which no workbook does; save it anew")
