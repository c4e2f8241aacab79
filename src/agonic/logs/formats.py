"""The kinds of files that are read, and how the first bytes of each are known.

Nothing but the standard library is imported here: a reader, with the libraries that it needs, is
imported when a file of its kind is opened.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from agonic.errors import AgonicError, LogError

HEAD_BYTES = 65536
"""How much of a file tells of its kind."""

_STRAY = 0.02
"""Share of control characters below which lines of plain letters are still text."""

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


class Format(NamedTuple):
    """A kind of file: what it is called, the module that reads it, and how its start is known. The
    module has `read(path, source, unit) -> Log`, or `read(path, source)` where the format fixes the
    unit of the field (`unit_fixed`). Where `mark` only says that the start may be of this kind, the
    module has `accepts(head)` too."""

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


def _starts(*marks: bytes) -> Callable[[bytes], bool]:
    """The mark of files that start with one of these."""
    return lambda head: head.startswith(marks)


def is_dataflash(head: bytes) -> bool:
    """Whether a message of type FMT stands in it, binary or text."""
    return bool(_FMT.search(head) or (b"FMT," in head and FMT_TEXT.search(head)))


def _is_first(head: bytes, *starts: bytes, end: bytes = b"") -> bool:
    """Whether the name of the first member of a ZIP archive begins, and ends, so."""
    name = head[30 : 30 + int.from_bytes(head[26:28], "little")]
    return head.startswith(b"PK\x03\x04") and name.startswith(starts) and name.endswith(end)


def _is_numpy(head: bytes) -> bool:
    return head.startswith(b"\x93NUMPY") or _is_first(head, b"", end=b".npy")


def _is_vires(head: bytes) -> bool:
    """Whether the first lines are a header with a time stamp and a row with a vector."""
    header, row, *_ = (head + b"\n\n").split(b"\n", 2)
    return b"Timestamp" in header.split(b",") and b"{" in row and b";" in row


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


def _is_text(head: bytes) -> bool:
    marks = (codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    if head.startswith(marks) or is_wide(head):
        return True
    written = head.rstrip(b"\0")
    stray = len(written.translate(None, bytes(range(32, 256)) + b"\t\n\r\f"))
    if stray:  # a serial line may add some
        return b"\n" in written and written.isascii() and stray < _STRAY * len(written)
    return bool(written)


def _is_bag(head: bytes) -> bool:
    """Whether it begins like a ROS 1 bag, an MCAP recording or the database of a ROS 2 bag."""
    database = head.startswith(b"SQLite format 3\0") and b"topics" in head and b"messages" in head
    return database or head.startswith((b"#ROSBAG V2", b"\x89MCAP0\r\n"))


def _is_workbook(head: bytes) -> bool:
    """Whether the first member of a ZIP archive is one of a document of an office."""
    opendocument = _is_first(head, b"mimetype", end=b"mimetype") and b"opendocument" in head[38:138]
    return opendocument or _is_first(head, b"[Content_Types].xml", b"_rels/", b"docProps/", b"xl/")


_JSON_BEGINS = re.compile(rb"\s*(\[\s*(\[\s*(-?\d+(\.\d+)?([eE][-+]?\d+)?\s*[],]|\")|\{)|\{)")
"""Not like the numbers without a comma, or without a digit behind the point, that NumPy prints."""


def _is_json(head: bytes) -> bool:
    """Whether it begins like an object, or a list of objects or of lists; a calibration is none."""
    head = decode_marked(head)
    begins = _JSON_BEGINS.match(head) is not None
    return begins and re.search(rb"\"schema\":\s*\"agonic/", head) is None


JSON = Format("JSON (.json, .jsonl)", "text.json_text", _is_json)
WORKBOOK = Format("workbooks (.xlsx, .ods)", "workbook", _is_workbook)
ARROW = Format("Arrow and Feather", "arrow", _starts(b"ARROW1\0\0", b"\xff\xff\xff\xff"))
DATABASE = Format("SQLite", "database", _starts(b"SQLite format 3\0"))
FOLDER = Format("ZIP archives and folders of tables", "folder", _starts(b"PK\x03\x04"))
ROS = Format("ROS bags (.bag, .db3, .mcap, a folder of ROS 2)", "ros.bag", _is_bag)
PARQUET = Format("Parquet", "parquet", _starts(b"PAR1"))
MATLAB = Format(
    "MATLAB (.mat)", "arrays.matlab", _starts(b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file")
)
TEXT = Format("text tables (.csv, .tsv, .txt)", "text.csv_text", _is_text)

FORMATS = (
    Format("PX4 ULog (.ulg)", "px4.ulog", _starts(b"ULog\x01\x12\x35"), unit_fixed=True),
    PARQUET,
    ROS,
    DATABASE,
    MATLAB,
    Format("NumPy (.npz, .npy)", "arrays.numpy_archive", _is_numpy),
    WORKBOOK,
    FOLDER,
    JSON,
    ARROW,
    Format("CDF", "space.cdf", _starts(b"\xcd\xf3\x00\x01", b"\xcd\xf2\x60\x02")),
    Format("netCDF", "space.netcdf", _starts(b"\x89HDF\r\n\x1a\n", b"CDF\x01", b"CDF\x02")),
    Format("IAGA-2002", "space.iaga2002", _starts(b" Format                 IAGA-2002")),
    Format("VirES", "space.variables", _is_vires),
    Format(  # a time stamp begins with a zero byte, which no text has
        "MAVLink telemetry (.tlog)", "ardupilot.tlog", lambda head: b"\0" in head, unit_fixed=True
    ),
    Format("ArduPilot dataflash (.bin, .log)", "ardupilot.dataflash", is_dataflash, True),
)
"""Files that begin with a mark, in the order in which they are tried; all others are `TEXT`."""

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


def format_of(head: bytes) -> Format:
    """The kind of a file that starts with these bytes, or a `LogError` that says what it is."""
    begins = head.removeprefix(codecs.BOM_UTF8).lstrip()
    # all of agonic's own begin with a brace or a tag, or have a line with a bracket
    if begins.startswith((b"{", b"<")) or head.startswith(b"[") or b"\n[" in head:
        from agonic.logs.contents import name_own

        if own := name_own(head):
            raise LogError(f"this is {own}")
    known: tuple[Format, ...] = (*FORMATS, *load_installed(READERS).values())
    for kind in known:
        if kind.accepts(head):
            return kind
    from agonic.logs.contents import read_not_logs

    for offset, mark, what in read_not_logs()["signatures"]:
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
