"""What is in a file, or a `LogError` that says why it cannot be had."""

from __future__ import annotations

import math
from pathlib import Path

from agonic.atomic import mark_input
from agonic.errors import LogError

MOST_BYTES = 500_000_000
"""Bytes of values that a file read into memory may hold; longer tables are read as Parquet."""
MOST_COMPRESSION = 1100
"""No file holds more than so many bytes of values for one of its own (deflate: 1032)."""
_SMALL = 1_000_000


def check_declared(declared: int, stored: int, what: str = "it") -> None:
    """Raise `LogError` where values would take more memory than is given to a file.

    Parameters: `declared`, bytes of the values; `stored`, bytes they have in the file.

    >>> check_declared(40_000_000_000, 1900)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    agonic.errors.LogError: it declares 40 GB of values and stores 1900 bytes of them: damaged, ...
    """
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
    """The bytes of a file.

    >>> read_bytes("nowhere.json")
    Traceback (most recent call last):
    agonic.errors.LogError: nowhere.json: there is no such file
    """
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
    """A text as a number, NaN where it is none.

    >>> to_number("12.5"), to_number("n/a")
    (12.5, nan)
    """
    try:
        return float(text)
    except ValueError:
        return math.nan


def name_content(data: bytes) -> str:
    """What the bytes of a file are, for an error where something else is needed.

    >>> name_content(b""), name_content(b"PAR1 and more"), name_content(b"time_s,mag_x_nT\\n0,1")
    ('empty', 'a file of the kind Parquet', 'a text, as tables of readings are')
    """
    from agonic.logs.formats import HEAD_BYTES, JSON, TEXT, format_of

    if not data.strip():
        return "empty"
    try:
        kind = format_of(data[:HEAD_BYTES])
    except LogError as error:
        what = str(error).partition(";")[0]
        return what.removeprefix("this is ").partition(", no log")[0]
    if kind == JSON:
        return "JSON of something else"
    return (
        "a text, as tables of readings are" if kind == TEXT else f"a file of the kind {kind.name}"
    )
