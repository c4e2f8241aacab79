"""Reading a recording: the kind of file is told by its content, not by its name."""

from __future__ import annotations

import hashlib
import lzma
import warnings
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from agonic.errors import AgonicError, LogError, MissingExtraError
from agonic.logs import formats
from agonic.logs.child_process import MOST_MEMORY, call
from agonic.logs.headers.column_names import ColumnNames, names_for
from agonic.logs.log import Log
from agonic.logs.remote import Remote, fetch, locate
from agonic.provenance import Input, hash_file
from agonic.samples import Samples
from agonic.units import find_unit

_ENDINGS = (".gz", ".gzip", ".bz2", ".xz", ".lzma", ".zst", ".zstd")
_PIECE = 1 << 20
_DAMAGE = (EOFError, OSError, zlib.error, lzma.LZMAError)


@contextmanager
def unpack(file: Path) -> Iterator[tuple[Path, tuple[str, ...]]]:
    """The file itself, or a temporary unpacked copy of a compressed one; and notes."""
    packing = formats.find_packing(file)
    if not packing:
        yield file, ()
        return
    name = file.stem if file.suffix.lower() in _ENDINGS else file.name
    with TemporaryDirectory(prefix="agonic-") as folder:
        plain = Path(folder, name or "log")
        yield plain, _write(file, packing, plain)


def _read_packed_head(file: Path, size: int) -> bytes:
    """The first bytes of a file, of a compressed one those that are packed in it."""
    packing = formats.find_packing(file)
    head = b""
    with _open(file, packing) if packing else file.open("rb") as stream, suppress(*_DAMAGE):
        take = getattr(stream, "read1", stream.read)  # before it fails, what there is
        while len(head) < size and (piece := take(size)):
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


def _write(file: Path, packing: str, plain: Path) -> tuple[str, ...]:
    """Unpack a file as far as it can be; a note where it ends early."""
    written = 0
    with _open(file, packing) as stream, plain.open("wb") as target:
        take = getattr(stream, "read1", stream.read)
        while True:
            try:
                piece = bytes(take(_PIECE))
            except _DAMAGE as error:
                if written:
                    return (f"the compressed file is damaged after {written} bytes of its content",)
                raise LogError(f"it cannot be unpacked ({error}); fetch it again") from None
            if not piece:
                return ()
            written += target.write(piece)
            if written > 2 * MOST_MEMORY:
                raise LogError("unpacked it takes more than 8 GB; unpack it, and cut it")


UNFORESEEN = "damaged, or not what it looks like"
"""What is said where a reader failed in a way that it does not foresee: `make fuzz` finds these."""
LONG_TEXT = 32_000_000
"""Bytes from which a text, which takes some twenty times as much memory, is read by a child."""


def open_log(
    path: Path | Remote | str,
    *,
    unit: str | None = None,
    columns: str | Mapping[str, str] | None = None,
) -> Log:
    """Everything that agonic reads from a recording: each magnetometer, and what else is there.

    Parameters
    ----------
    path : the file; its content decides how it is read. A URL (s3://bucket/log.bin) is fetched,
        a file packed with gzip, bzip2, xz or Zstandard unpacked.
    unit : of the field, for files that do not say: "nT", "uT", "mT", "T", "G", "mG".
    columns : what the columns are, where headers do not say: "time=t,x=mx,y=my,z=mz", or a mapping;
        without, those in a file beside the log with its name and ".toml" behind it.

    Raises `LogError` where the file cannot be read or holds no magnetometer, `UnitError` where the
    unit is unknown, `MissingExtraError` where reading it needs an optional package.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "log.csv")
    ...     _ = path.write_text("time_s,mag_x_uT,mag_y_uT,mag_z_uT\\n0,20,0,43\\n1,0,20,43\\n")
    ...     open_log(path).sensors[0].field[0].tolist()
    [20000.0, 0.0, 43000.0]
    """
    if path == "":
        raise LogError("no file was named: the path is empty")
    file = locate(path)
    if file == Path():  # what is read is named
        file = Path.cwd()
    if isinstance(file, Remote):
        with fetch(file) as copy:
            try:
                log = open_log(copy, unit=unit, columns=columns)
            except LogError as error:
                said = str(error).removeprefix(f"{copy}").lstrip(":, ")
                raise type(error)(said, path=file.url) from error
        return replace(log, path=Path(file.name))
    if unit is not None:
        find_unit(unit)
    try:
        with unpack(file) as (plain, notes), names_for(file, columns) as names:
            log = _open_plain(plain, file, unit or (names.unit if names else None), names)
        return replace(log, path=file, notes=(*notes, *log.notes))
    except LogError as error:
        if error.path is not None:
            raise
        raise type(error)(str(error), path=file, row=error.row) from error
    except OSError as error:
        raise LogError(f"cannot be read: {error.strerror or error}", path=file) from error


def _open_plain(plain: Path, file: Path, unit: str | None, names: ColumnNames | None) -> Log:
    """The log of a file that lies unpacked at `plain`, with the name and the hash of itself."""
    if (plain / formats.METADATA).is_file():
        kind = formats.ROS
    else:
        kind = formats.FOLDER if plain.is_dir() else formats.format_of(_head(plain))
    source = Input(name=file.name, sha256="", count=0)
    if file.is_file() and file.stat().st_size < _PIECE:  # a thread starts as fast
        return _sign(_read(kind, plain, source, unit, names), _hash(file))
    with ThreadPoolExecutor(1) as beside:
        hashed = beside.submit(_hash, file)  # a tenth of the time, on another core
        return _sign(_read(kind, plain, source, unit, names), hashed.result())


def sensors(path: Path | str) -> tuple[str, ...]:
    """The names of the magnetometers in a recording.

    Parameters: `path` of the recording.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "cloud.txt")
    ...     _ = path.write_text("1 2 3\\n4 5 6\\n")
    ...     sensors(path)
    ('mag',)
    """
    return tuple(sensor.name for sensor in open_log(path).sensors)


def read(
    path: Path | str,
    sensor: str | int | None = None,
    *,
    unit: str | None = None,
    columns: str | Mapping[str, str] | None = None,
) -> Samples:
    """The readings of one magnetometer of a recording.

    Parameters
    ----------
    path : the file; its content decides how it is read.
    sensor : its name, or its position in `sensors(path)`, from 0; without, the first.
    unit : of the field, for files that do not say.
    columns : what the columns are, where headers do not say: "time=t,x=mx,y=my,z=mz", or a mapping.

    Raises as `open_log` does, and `LogError` naming the sensors where none is called `sensor`.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "cloud.txt")
    ...     _ = path.write_text("1 2 3\\n4 5 6\\n")
    ...     read(path).unit, len(read(path, unit="mG"))
    ('raw', 2)
    """
    log = open_log(path, unit=unit, columns=columns)
    return log.sensor(0 if sensor is None else sensor)


def _hash(file: Path) -> str:
    """The SHA-256 of a recording; of a folder, that of those of its files."""
    if file.is_file():
        return hash_file(file)
    parts = sorted(part for part in file.iterdir() if part.is_file())
    return hashlib.sha256("".join(map(hash_file, parts)).encode()).hexdigest()


def _sign(log: Log, sha256: str) -> Log:
    """The log with the hash of its file wherever that is named, its sensors numbered where names
    differ in case alone: a file of each must have its own. File systems of Windows and macOS take
    "MAG.json" and "mag.json" for one file."""
    times: Counter[str] = Counter()
    sensors = []
    for one in log.sensors:
        times[one.name.lower()] += 1
        if (number := times[one.name.lower()]) > 1:
            note = f"named {one.name!r} in the file, as another is but for capital letters"
            one = one.with_columns(name=f"{one.name} #{number}", notes=(*one.notes, note))
        sensors.append(one.with_source(replace(one.source or log.source, sha256=sha256)))
    return replace(log, source=replace(log.source, sha256=sha256), sensors=tuple(sensors))


def _head(file: Path) -> bytes:
    """The first bytes of a file, or a clear error where there is nothing to read."""
    if not file.exists():
        raise LogError("there is no such file")
    if not file.is_file():
        raise LogError("this is a device or a pipe, not a file")
    if not (head := formats.read_head(file)):
        raise LogError("the file is empty")
    return head


def _read(
    kind: formats.Format, file: Path, source: Input, unit: str | None, names: ColumnNames | None
) -> Log:
    """The log that the reader makes of the file; whatever a parser raises becomes a `LogError`."""
    request = kind, file, source, unit, names
    long = kind in (formats.TEXT, formats.JSON) and file.stat().st_size > LONG_TEXT
    # what is packed in some may be of any length: it may take far more memory than is at hand
    huge = long or (kind in (formats.FOLDER, formats.ARROW, formats.WORKBOOK) and file.is_file())
    try:
        log = call(_read_here, request) if huge else _read_here(request)
    except AgonicError:
        raise
    except MemoryError as error:
        raise LogError(
            f"reading it takes more than {MOST_MEMORY / 1e9:g} GB of memory, the limit, and "
            f"it has {file.stat().st_size / 1e6:.3g} MB: damaged, or too long; cut it, or make "
            "it Parquet, which is read piece by piece"
        ) from error
    except Exception as error:  # parsers fail on damaged files in every way there is
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise LogError(f"{UNFORESEEN} ({reason}); fetch it again") from error
    if not kind.unit_fixed or unit is None:
        return log
    note = f"the format fixes the unit of the field: the given unit {unit} is not used"
    return replace(log, notes=(*log.notes, note))


def _read_here(request: tuple[formats.Format, Path, Input, str | None, Any]) -> Log:
    kind, file, source, unit, names = request
    with warnings.catch_warnings(), names_for(file, names):
        warnings.simplefilter("ignore")  # what is odd in a file goes into the notes
        from agonic.logs.groups import read_file

        return read_file(kind, file, source, unit)


def accepts(path: Path | str) -> bool:
    """Whether a file, or what is packed in it, begins like what `open_log` reads; any text does."""
    try:
        _head(Path(path))
        formats.format_of(_read_packed_head(Path(path), formats.HEAD_BYTES))
    except (AgonicError, OSError):
        return False
    return True
