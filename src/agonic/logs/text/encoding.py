"""The bytes of a text file as UTF-8 with plain line ends."""

from __future__ import annotations

import mmap
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from agonic.logs.formats import COLOUR, HEAD_BYTES, decode_marked, is_wide
from agonic.logs.log import TORN

Text = bytes | mmap.mmap
"""A text as it lies in memory, or in a file that is mapped."""

_LONG = 1_000_000
_HEAD = 4 * HEAD_BYTES
_ENCODINGS = {
    "latin-1": "Latin-1",
    "cp1251": "Windows-1251",
    "gb18030": "GB 18030",
    "cp932": "Shift JIS",
    "cp949": "EUC-KR",
}
_DIGITS = re.compile(rb"[-+]?[\d.]+(?:[eE][-+]?\d*)?")
_MINUS = "\u2212".encode()
_CONTROL = bytes({*range(32), 127} - set(b"\t\n"))


def load(path: Path, understood: Callable[[str], int]) -> tuple[Text, tuple[str, ...]]:
    """The text of a file as `normalise` makes it; a long plain one is mapped and not copied."""
    if path.stat().st_size > _LONG:
        with path.open("rb") as stream:
            mapped = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
        pieces = (mapped[at : at + _LONG] for at in range(0, len(mapped), _LONG))
        plain = (
            p.isascii() and not any(sign in p for sign in (b"\r", b"\0", b"\x1b")) for p in pieces
        )
        if mapped[-1:] == b"\n" and all(plain):
            return mapped, ()
    return normalise(path.read_bytes(), understood)


def normalise(data: bytes, understood: Callable[[str], int]) -> tuple[bytes, tuple[str, ...]]:
    """A text in any of the usual encodings as UTF-8 with plain line ends, and notes. `understood`
    counts the columns that make sense in the start of a text: where bytes are not UTF-8, the
    encoding is taken in which most do."""
    notes: tuple[str, ...] = ()
    data = decode_marked(data)
    if is_wide(data):
        data = data.decode("utf-16-le", "replace").encode()
    elif not data.isascii():
        try:
            data.decode("utf-8")
        except UnicodeDecodeError:
            counts = {name: understood(data[:_HEAD].decode(name, "ignore")) for name in _ENCODINGS}
            best = max(counts, key=lambda name: counts[name])
            notes = (f"some bytes are not UTF-8: read as {_ENCODINGS[best]}",)
            data = data.decode(best, "replace").encode()
        data = data.replace(_MINUS, b"-")
    if b"\x1b[" in data:
        data = COLOUR.sub(b"", data)
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if not data.endswith(b"\n") and (whole := _find_torn(data)) < len(data):
        data, notes = data[:whole], (*notes, TORN)
    head = data[:_HEAD]
    if b"\0" in data or head != head.translate(None, _CONTROL):
        data = data.translate(None, _CONTROL)
    return data, notes


def _find_torn(data: bytes) -> int:
    """The byte at which a last line without an end begins that is the beginning of such as come
    before it, or whose last number is shorter than those of all lines like it. The length of the
    text where there is none."""
    start = data.rfind(b"\n") + 1
    last = data[start:].strip()
    before = [line.strip() for line in data[max(start - 10_000, 0) : start].split(b"\n")]
    shape = _DIGITS.sub(b"#", last)
    shapes = [_DIGITS.sub(b"#", line) for line in before]
    usual, times = Counter(shapes).most_common(1)[0]
    if shape and times > 2 and usual != shape and usual.startswith(shape):
        return start
    alike = (line for line, one in zip(before, shapes, strict=True) if one == shape)
    lengths = [len(found[-1]) for line in alike if (found := _DIGITS.findall(line))]
    digits = _DIGITS.findall(last)
    torn = len(lengths) > 2 and bool(digits) and last.endswith(digits[-1])
    return start if torn and len(digits[-1]) < min(lengths) else len(data)
