"""What is in a file, or a `LogError` that says why it cannot be had."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from agonic.atomic import mark_input
from agonic.errors import AgonicError, LogError


@contextmanager
def explain_damage(said: str = "damaged") -> Iterator[None]:
    """What a library makes of damaged bytes, which may be any exception, as a `LogError`."""
    try:
        yield
    except (AgonicError, MemoryError):
        raise
    except Exception as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise LogError(f"{said} ({reason}); fetch it again") from error


MOST_BYTES = 500_000_000
"""Bytes of values that a file read into memory may hold; longer tables are read as Parquet."""
MOST_COMPRESSION = 1100
"""No file holds more than so many bytes of values for one of its own (deflate: 1032)."""
_SMALL = 1_000_000
MOST_PARTS = 64
"""Files, sheets or sensors of one recording."""
DEEPEST = 6
"""Groups, structures or objects within others."""


def check_declared(declared: int, stored: int, what: str = "it") -> None:
    """Raise `LogError` where values would take more memory than is given to a file. Parameters:
    `declared`, bytes of the values; `stored`, bytes they have in the file."""
    if declared > MOST_BYTES:
        raise LogError(
            f"{what} declares {declared / 1e9:.3g} GB of values and stores {stored} bytes of them: "
            f"damaged, or too long for memory ({MOST_BYTES / 1e9:g} GB); cut it, or make it Parquet"
        )
    if declared > max(_SMALL, MOST_COMPRESSION * stored):
        raise LogError(
            f"{what} declares {declared / 1e6:.3g} MB of values and stores {stored} bytes of them: "
            "damaged, or nothing was written there; fetch it again"
        )


def read_bytes(path: Path | str) -> bytes:
    """The bytes of a file."""
    try:
        if Path(path).exists() and not Path(path).is_file():
            what = "it is a folder: name a file in it" if Path(path).is_dir() else "it is no file"
            raise LogError(what, path=path)
        mark_input(path)
        return Path(path).read_bytes()
    except FileNotFoundError:
        raise LogError("there is no such file", path=path) from None
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise LogError(f"cannot be read ({why})", path=path) from None


def read_text(path: Path | str, needed: str = "a text table") -> str:
    """The text of a file, with plain line ends; `needed` says what it should be."""
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise LogError(f"this is not text; {needed} is needed", path=path) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def to_number(text: str | bytes) -> float:
    """A text as a number, NaN where it is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan
