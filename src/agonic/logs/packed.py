"""Compressed recordings: gzip, bzip2, xz or Zstandard around one file of any kind that is read."""

from __future__ import annotations

import lzma
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from agonic.errors import LogError, MissingExtraError
from agonic.logs.formats import find_packing

_ENDINGS = (".gz", ".gzip", ".bz2", ".xz", ".lzma", ".zst", ".zstd")
_MOST_BYTES = 8_000_000_000
_PIECE = 1 << 20
_DAMAGE = (EOFError, OSError, zlib.error, lzma.LZMAError)


@contextmanager
def unpack(file: Path) -> Iterator[tuple[Path, tuple[str, ...]]]:
    """A plain copy of a compressed file for as long as it is needed, and notes.

    Raises `LogError` where nothing can be unpacked, or more than 8 GB would be.

    >>> import gzip
    >>> with TemporaryDirectory() as folder:
    ...     packed = Path(folder, "log.csv.gz")
    ...     _ = packed.write_bytes(gzip.compress(b"1 2 3"))
    ...     with unpack(packed) as (plain, notes):
    ...         plain.name, plain.read_text()
    ('log.csv', '1 2 3')
    """
    packing = find_packing(file)
    name = file.stem if file.suffix.lower() in _ENDINGS else file.name
    with TemporaryDirectory(prefix="agonic-") as folder:
        plain = Path(folder, name or "log")
        yield plain, _write(file, packing, plain)


def read_head(file: Path, size: int) -> bytes:
    """The first bytes of a file, of a compressed one those that are packed in it."""
    packing = find_packing(file)
    head = b""
    with _open(file, packing) if packing else file.open("rb") as stream, suppress(*_DAMAGE):
        while len(head) < size and (piece := _take(stream, size)):
            head += piece
    return head[:size]


def _open(file: Path, packing: str) -> Any:
    """A stream of what is packed in a file."""
    if packing != "zstd":
        return import_module(packing).open(file)
    try:
        import pyarrow
    except ImportError:
        raise MissingExtraError("reading a file packed with Zstandard", "tables") from None
    return pyarrow.CompressedInputStream(pyarrow.OSFile(str(file)), "zstd")


def _take(stream: Any, size: int) -> bytes:
    """The next bytes; before the stream fails, those that there are."""
    return bytes(getattr(stream, "read1", stream.read)(size))


def _write(file: Path, packing: str, plain: Path) -> tuple[str, ...]:
    """Unpack a file as far as it can be; a note where it ends early."""
    written = 0
    with _open(file, packing) as stream, plain.open("wb") as target:
        while True:
            try:
                piece = _take(stream, _PIECE)
            except _DAMAGE as error:
                if written:
                    return (f"the compressed file is damaged after {written} bytes of its content",)
                raise LogError(f"it cannot be unpacked ({error}); fetch it again") from None
            if not piece:
                return ()
            written += target.write(piece)
            if written > _MOST_BYTES:
                raise LogError("unpacked it takes more than 8 GB; unpack it, and cut it")
