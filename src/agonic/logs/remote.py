"""`Remote`: a file in object storage, read where it lies; `fetch`: a copy of one.

A URL such as s3://bucket/day/log.parquet is opened by pyarrow's own file systems (s3, gs, abfs,
hdfs), any other by fsspec. Keys, region and endpoint are those of the environment, as the storage's
own tools have them (AWS_ACCESS_KEY_ID, AWS_ENDPOINT_URL, …).
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any

from agonic.errors import LogError, MissingExtraError

NATIVE = frozenset(("s3", "gs", "gcs", "abfs", "abfss", "hdfs", "viewfs"))
"""What pyarrow opens without fsspec."""
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")
_PIECE = 1 << 22  # bytes; a request costs some hundredths of a second


@dataclass(frozen=True)
class Remote:
    """A file in object storage; its methods are those of `Path` that readers use."""

    url: str

    @property
    def name(self) -> str:
        """The last part of the path, without what follows a question mark."""
        return PurePosixPath(self.url.partition("?")[0]).name

    suffix = property(lambda self: PurePosixPath(self.name).suffix)
    stem = property(lambda self: PurePosixPath(self.name).stem)

    def measure(self) -> tuple[int, int]:
        """Bytes, and when it was written, ns."""
        found = self._describe()
        return int(found.size or 0), int(found.mtime_ns or 0)

    def _describe(self) -> Any:
        system, path = _find_system(self.url)
        with _explain_errors(self.url):
            return system.get_file_info(path)

    def open(self, mode: str = "rb") -> Any:
        """A file to be read in any order, and in no other mode."""
        system, path = _find_system(self.url)
        with _explain_errors(self.url):
            return system.open_input_file(path)

    def is_file(self) -> bool:
        """Whether it is there."""
        from pyarrow.fs import FileType

        return bool(self._describe().type == FileType.File)

    def hash(self) -> str:
        """The SHA-256 of its content, for which all of it is read once."""
        with _explain_errors(self.url), self.open() as stream:
            found = hashlib.sha256()
            while piece := stream.read(_PIECE):
                found.update(piece)
            return found.hexdigest()

    def __str__(self) -> str:
        return self.url


def is_remote(name: Path | Remote | str) -> bool:
    """Whether a name is a URL."""
    return isinstance(locate(name), Remote)


def locate(name: Path | Remote | str) -> Path | Remote:
    """The file that a path or a URL names, also a URL that was made a `Path`."""
    if isinstance(name, Remote):
        return name
    if isinstance(name, str):
        return Remote(name) if _URL.match(name) else Path(name)
    scheme, colon, rest = name.as_posix().partition(":/")
    return Remote(f"{scheme}://{rest}") if colon and scheme in NATIVE else name


def name_locally(file: Path | Remote) -> Path:
    """The path, or the mere name of a remote file, for what names a log by its path."""
    return Path(file.name) if isinstance(file, Remote) else file


@contextmanager
def fetch(name: Path | Remote | str) -> Iterator[Path]:
    """The file itself, or a copy of a remote one that is there as long as it is needed."""
    file = locate(name)
    if isinstance(file, Path):
        yield file
        return
    with TemporaryDirectory(prefix="agonic-") as folder:
        copy = Path(folder, file.name or "log")
        with _explain_errors(file.url), file.open() as stream, copy.open("wb") as target:
            while piece := stream.read(_PIECE):
                target.write(piece)
        yield copy


def list_remote(url: str) -> list[Remote]:
    """The files below a folder in object storage, or the one file that it names."""
    from pyarrow.fs import FileSelector, FileType

    if Remote(url).is_file():
        return [Remote(url)]
    system, path = _find_system(url)
    with _explain_errors(url):
        below = system.get_file_info(FileSelector(path, recursive=True, allow_not_found=True))
    head, mark, asked = url.partition("?")
    start = head[: len(head.rstrip("/")) - len(path.rstrip("/"))]
    found = [
        Remote(f"{start}{one.path}{mark}{asked}") for one in below if one.type == FileType.File
    ]
    if not found:
        raise LogError("there is no such file or folder", path=url)
    return sorted(found, key=str)


def _find_system(url: str) -> tuple[Any, str]:
    """The file system of a URL, and the path in it."""
    try:
        from pyarrow.fs import FileSystem, FSSpecHandler, PyFileSystem
    except ImportError:
        raise MissingExtraError("a file in object storage", "tables") from None
    with _explain_errors(url):
        if url.partition("://")[0] in NATIVE:
            system, path = FileSystem.from_uri(url.replace(" ", "%20"))
            return system, str(path)
        try:
            from fsspec.core import url_to_fs
        except ImportError:
            raise MissingExtraError(f"a file at {url}", "remote") from None
        system, path = url_to_fs(url)
        return PyFileSystem(FSSpecHandler(system)), str(path)


@contextmanager
def _explain_errors(url: str) -> Iterator[None]:
    """What storage objects to, as a `LogError`."""
    try:
        yield
    except (OSError, ValueError, ImportError) as error:
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0][:300]
        raise LogError(
            f"the storage says: {reason}; check the address, and the keys and the endpoint in the "
            "environment (AWS_ACCESS_KEY_ID, AWS_ENDPOINT_URL)",
            path=url,
        ) from error
