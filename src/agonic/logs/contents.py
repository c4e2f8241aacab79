"""What is in a file, or a `LogError` that says why it cannot be had."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from agonic.atomic import mark_input
from agonic.errors import AgonicError, LogError

_SECTION = re.compile(rb"^\[{1,2}([\w.]+)\]{1,2}\s*(?:#.*)?$", re.MULTILINE)
_SETTING = re.compile(rb"^[\w.-]+ *= *(?:[\"'\[{\d+-]|true|false)", re.MULTILINE)
_SCHEMA = re.compile(rb"\s*\{\s*\"schema\":\s*\"agonic/([\w-]{1,40})@")
_GENERATOR = b'<meta name="generator" content="agonic">'

_CALIBRATION = (
    "a calibration, no log: agonic report CAL shows it, agonic apply CAL LOG -o OUT corrects a log "
    "with it; name the log that it is for"
)


@cache
def read_not_logs() -> dict[str, Any]:
    """The table of kinds of files that are not logs, from `not_logs.toml`."""
    return tomllib.loads(Path(__file__).with_name("not_logs.toml").read_text("utf-8"))


def name_own(head: bytes) -> str:
    r"""What a file that starts with these bytes is, if agonic wrote it or reads it as settings."""
    if schema := _SCHEMA.match(head.removeprefix(b"\xef\xbb\xbf")):
        kind = schema[1].decode()
        result = f"a result of agonic (agonic/{kind}), no log; name the log it was made from"
        return _CALIBRATION if kind == "calibration" else result
    if head.lstrip().startswith(b"<") and _GENERATOR in head:
        return "a report of agonic, no log; name the log it was made from"
    if b"\0" in head:  # binary: first, for the search for sections would take longer than a reader
        return ""
    sections = _SECTION.findall(head)
    if not sections or not _SETTING.search(head):
        return ""
    settings = read_not_logs()["settings"]
    known = next((settings[n] for name in sections if (n := name.decode()) in settings), "")
    return known or "a file of settings (TOML), no log; name the log"


def name_own_table(headers: Iterable[str]) -> str:
    """What a table without a magnetometer is, by its headers, if agonic wrote it."""
    there, tables = set(headers), read_not_logs()["tables"]
    return next((what for marks, what in tables.items() if {*marks.split()} <= there), "")


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
