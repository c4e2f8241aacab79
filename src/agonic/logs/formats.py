"""The kinds of files that are read, and how the first bytes of each are known: `formats.toml`. It
also tells what files are that are no logs.

Nothing but the standard library is imported here: a reader, with the libraries that it needs, is
imported when a file of its kind is opened.
"""

from __future__ import annotations

import codecs
import re
import tomllib
from collections.abc import Callable, Iterable
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from agonic.errors import AgonicError, LogError

KINDS: dict[str, Any] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
HEAD_BYTES = 65536
"""How much of a file tells of its kind."""
METADATA = "metadata.yaml"
"""What makes a folder a ROS 2 bag."""

_FMT = re.compile(rb"\xa3\x95\x80..\w{1,4}\0{0,3}[A-Za-z]{1,16}\0*\w", re.DOTALL)
FMT_TEXT = re.compile(rb"^FMT, ?\d+, ?\d+, ?\w+, ?\w+, ?\w+", re.MULTILINE)
"""A message of type FMT of a dataflash log: type, length, name, letters and columns."""

PACKED = {
    b"\x1f\x8b\x08": "gzip",
    b"BZh": "bz2",
    b"\xfd7zXZ\0": "lzma",
    b"\x28\xb5\x2f\xfd": "zstd",
}
"""How a compressed file begins, and what unpacks it: a module of Python's, or pyarrow for zstd."""


def find_packing(file: Path) -> str:
    """What unpacks a file; "" where it is plain, or no file."""
    if not file.is_file():
        return ""
    with file.open("rb") as stream:
        head = stream.read(8)
    return next((packing for mark, packing in PACKED.items() if head.startswith(mark)), "")


def read_head(file: Path) -> bytes:
    """The first bytes of a file."""
    with file.open("rb") as stream:
        return stream.read(HEAD_BYTES)


class Format(NamedTuple):
    """A kind of file: what it is called, the module that reads it, and how its start is known. The
    module has `read_tables(path) -> Found`, or `read(path, source, unit) -> Log`, without the unit
    where the format fixes that of the field (`unit_fixed`). Where `mark` only says that the start
    may be of this kind, the module has `accepts(head)` too."""

    name: str
    module: str
    mark: Callable[[bytes], bool]
    unit_fixed: bool = False
    package: str = "agonic.logs."

    def __reduce__(self) -> tuple[Any, ...]:  # a mark is a function without a name
        return find_format, (self.name,)

    @property
    def reader(self) -> ModuleType:
        """The module that reads it, imported now."""
        return import_module(self.package + self.module)

    def accepts(self, head: bytes) -> bool:
        """Whether a file that starts with these bytes is of this kind."""
        if not self.mark(head):
            return False
        return not hasattr(self.reader, "accepts") or bool(self.reader.accepts(head))


def is_dataflash(head: bytes) -> bool:
    """Whether a message of type FMT stands in it, binary or text."""
    return bool(_FMT.search(head) or (b"FMT," in head and FMT_TEXT.search(head)))


def is_wide(data: bytes) -> bool:
    """Whether the start is UTF-16 with the low byte first, of plain letters and without a mark."""
    low, high = data[:400:2], data[1:400:2]
    return len(high) >= 10 and not any(high) and low.isascii() and 0 not in low


def decode_marked(data: bytes) -> bytes:
    """A text whose first bytes say that it is UTF-8 or UTF-16, as UTF-8 without them; any other as
    it is."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", "replace").encode()
    return data.removeprefix(codecs.BOM_UTF8)


COLOUR = re.compile(rb"\x1b\[[\d;]*[A-Za-z]")
"""What tells a terminal the colour of a line."""


def _is_text(head: bytes) -> bool:
    marks = (codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    if head.startswith(marks) or is_wide(head):
        return True
    written = COLOUR.sub(b"", head.rstrip(b"\0"))
    stray = len(written.translate(None, bytes(range(32, 256)) + b"\t\n\r\f"))
    if stray:  # a serial line may add some
        return b"\n" in written and written.isascii() and stray < 0.02 * len(written)
    return bool(written)


_JSON_BEGINS = re.compile(rb"\s*(\[\s*(\[\s*(-?\d+(\.\d+)?([eE][-+]?\d+)?\s*[],]|\")|\{)|\{)")
"""Not like the numbers without a comma, or without a digit behind the point, that NumPy prints."""


def _is_json(head: bytes) -> bool:
    """Whether it begins like an object, or a list of objects or of lists; a calibration is none."""
    head = decode_marked(head)
    begins = _JSON_BEGINS.match(head) is not None
    return begins and re.search(rb"\"schema\":\s*\"agonic/", head) is None


JSON = Format("JSON (.json, .jsonl)", "text.json_text", _is_json)
TEXT = Format("text tables (.csv, .tsv, .txt)", "text.csv_text", _is_text)


def _make_format(mark: str, **row: Any) -> Format:
    """The kind of file that a row of the table tells of."""
    begins = re.compile(mark.encode("latin-1"), re.DOTALL)
    return Format(mark=lambda head: begins.match(head) is not None, **row)


FORMATS = (
    *(_make_format(**row) for row in KINDS["formats"]),
    JSON,
    Format("ArduPilot dataflash (.bin, .log)", "ardupilot.dataflash", is_dataflash, True),
)
"""Files that begin with a mark, in the order in which they are tried; all others are `TEXT`."""
PARQUET, ROS, MATLAB, WORKBOOK, FOLDER, ARROW = (
    next(kind for kind in FORMATS if kind.name.startswith(name))
    for name in ("Parquet", "ROS", "MATLAB", "workbooks", "ZIP", "Arrow")
)

READERS = "agonic.readers"
"""The entry points by which an installed package adds a `Format`."""
READ = (
    "agonic reads tables (text, Excel, JSON, Parquet, Arrow, SQLite, MATLAB, NumPy), logs of "
    "ArduPilot, PX4 and MAVLink, ROS bags, CDF, netCDF and IAGA-2002"
)


def find_format(name: str) -> Format:
    """The kind of file of that name."""
    every: tuple[Format, ...] = (*FORMATS, TEXT, *load_installed(READERS).values())
    return next(kind for kind in every if kind.name == name)


@cache
def load_installed(group: str) -> dict[str, Any]:
    """What installed packages add to agonic, by name: their entry points of a group."""
    from importlib.metadata import entry_points

    loaded = {}
    for point in entry_points(group=group):
        try:
            loaded[point.name] = point.load()
        except Exception as error:  # whatever is wrong with it, it is the package's
            raise AgonicError(
                f"{point.value}, installed for {group}, cannot be imported ({error}); repair or "
                "uninstall its package"
            ) from error
    return loaded


_SECTION = re.compile(rb"^\[{1,2}([\w.]+)\]{1,2}\s*(?:#.*)?$", re.MULTILINE)
_SETTING = re.compile(rb"^[\w.-]+ *= *(?:[\"'\[{\d+-]|true|false)", re.MULTILINE)
_SCHEMA = re.compile(rb"\s*\{\s*\"schema\":\s*\"agonic/([\w-]{1,40})@")
_GENERATOR = b'<meta name="generator" content="agonic">'


def name_own(head: bytes) -> str:
    r"""What a file that starts with these bytes is, if agonic wrote it or reads it as settings."""
    if schema := _SCHEMA.match(head.removeprefix(b"\xef\xbb\xbf")):
        kind = schema[1].decode()
        result = f"a result of agonic (agonic/{kind}), no log; name the log it was made from"
        return KINDS["calibration"] if kind == "calibration" else result
    if head.lstrip().startswith(b"<") and _GENERATOR in head:
        return "a report of agonic, no log; name the log it was made from"
    if b"\0" in head:  # binary: first, for the search for sections would take longer than a reader
        return ""
    sections = _SECTION.findall(head)
    if not sections or not _SETTING.search(head):
        return ""
    settings = KINDS["settings"]
    known = next((settings[n] for name in sections if (n := name.decode()) in settings), "")
    return known or "a file of settings (TOML), no log; name the log"


def name_own_table(headers: Iterable[str]) -> str:
    """What a table without a magnetometer is, by its headers, if agonic wrote it."""
    there, tables = set(headers), KINDS["tables"]
    return next((what for marks, what in tables.items() if {*marks.split()} <= there), "")


def format_of(head: bytes) -> Format:
    """The kind of a file that starts with these bytes, or a `LogError` that says what it is."""
    begins = head.removeprefix(codecs.BOM_UTF8).lstrip()
    # all of agonic's own begin with a brace or a tag, or have a line with a bracket
    marked = begins.startswith((b"{", b"<")) or head.startswith(b"[") or b"\n[" in head
    if marked and (own := name_own(head)):
        raise LogError(f"this is {own}")
    known: tuple[Format, ...] = (*FORMATS, *load_installed(READERS).values())
    for kind in known:
        if kind.accepts(head):
            return kind
    for offset, mark, what in KINDS["signatures"]:
        if head[offset:].startswith(mark.encode("latin-1")):
            raise LogError(f"this is {what}, no log; {READ}")
    if not TEXT.accepts(head):
        raise LogError(f"this is binary data of a kind that is not known; {READ}")
    return TEXT


def name_content(data: bytes) -> str:
    """What the bytes of a file are, for an error where something else is needed."""
    if not data.strip():
        return "empty"
    try:
        kind = format_of(data[:HEAD_BYTES])
    except LogError as error:
        what = str(error).partition(";")[0]
        return what.removeprefix("this is ").partition(", no log")[0]
    said = {JSON: "JSON of something else", TEXT: "a text, as tables of readings are"}
    return said.get(kind, f"a file of the kind {kind.name}")
