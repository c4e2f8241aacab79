"""Writing a file so that a reader sees the old one or the whole new one, never a part.

Under `protect`, as every command runs, no file that was read is written over, and one that
agonic did not write only where that was asked for.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from agonic.errors import AgonicError

_ATTRIBUTE = "user.agonic.sha256"
_MARKS = re.compile(
    rb'"schema":\s*"agonic/'
    rb'|<meta name="generator" content="agonic'
    rb"|\A(?:#|%|;|//|/\*|MATLAB)(?! Written by agonic)[^\n]*\bagonic\b"
    rb"|agonic/population@"
)
"""What files of agonic have near their start or their end."""
_SIGNED = re.compile(rb"# Written by agonic, checksum ([0-9a-f]{8})\n(.*)", re.DOTALL)
_NEAR = 4096
_STALE_S = 86_400.0
_HOST = re.sub(r"\W", "", socket.gethostname())[:20] or "host"


@dataclass
class _Protection:
    """What must not be written over: files that were read (by identity), and foreign ones."""

    force: bool
    inputs: dict[tuple[int, int], Path] = field(default_factory=dict)
    written: set[str] = field(default_factory=set)


_protection: _Protection | None = None
_tidied: set[Path] = set()


@contextmanager
def protect(*, force: bool = False) -> Iterator[None]:
    """Guard what is there against `write_atomically` until the end of the block.

    A file that `mark_input` was told of is never replaced; one that agonic did not write only with
    `force`.
    """
    global _protection
    before, _protection = _protection, _Protection(force)
    try:
        yield
    finally:
        _protection = before


def list_written() -> list[str]:
    """The files that were written since `protect` began, as they are named from here."""
    written = () if _protection is None else _protection.written
    return sorted(os.path.relpath(path) for path in written if Path(path).exists())


def overwrite_all() -> None:
    """Let files that agonic did not write be replaced until the end of `protect`."""
    if _protection is not None:
        _protection.force = True


def mark_input(path: Path | str) -> None:
    """Note that a file is read, so that it is not written over; one written before is not noted."""
    if _protection is None or os.path.realpath(path) in _protection.written:
        return
    with suppress(OSError, ValueError):
        status = os.stat(path)
        _protection.inputs[status.st_dev, status.st_ino] = Path(path)


def allow_replacing(path: Path | str) -> None:
    """Take back that a file was read: what it held is shown beside what takes its place."""
    if _protection is not None:
        with suppress(OSError, ValueError):
            status = os.stat(path)
            _protection.inputs.pop((status.st_dev, status.st_ino), None)


def check_target(path: Path | str, content: bytes | None = None) -> None:
    """Raise `AgonicError` where `path` must not be written, with `content` if it is known already.

    >>> check_target("nowhere/cal.json")
    Traceback (most recent call last):
    agonic.errors.AgonicError: cannot write nowhere/cal.json: there is no folder nowhere; create it
    """
    try:
        target = Path(os.path.realpath(path))
        if not target.parent.is_dir():
            parent = Path(path).parent
            raise AgonicError(f"cannot write {path}: there is no folder {parent}; create it")
        if not target.exists():
            return
        if not target.is_file():
            raise AgonicError(f"cannot write {path}: it is a folder or a device, not a file")
        _check_replacing(path, target, content)
    except (OSError, ValueError) as error:
        raise AgonicError(f"cannot write {path}: {_words(error)}") from error


def _check_replacing(path: Path | str, target: Path, content: bytes | None) -> None:
    """Raise `AgonicError` where the file that is there has to stay."""
    if _protection is None or str(target) in _protection.written:
        return
    status = target.stat()
    read = _protection.inputs.get((status.st_dev, status.st_ino))
    if read is not None:
        raise AgonicError(
            f"cannot write {path}: it is {read}, which this command reads; give another name"
        )
    if not (_protection.force or is_written_by_agonic(target, content)):
        raise AgonicError(
            f"cannot write {path}: a file that agonic did not write, or that was changed since, is "
            "there; give another name, or --force to replace it"
        )


def is_written_by_agonic(path: Path, content: bytes | None = None) -> bool:
    """Whether a file is one of agonic's, empty, or what is to be written to it.

    Known by a mark in its content or, for tables, by the digest of the content that was written.
    """
    size = path.stat().st_size
    with path.open("rb") as stream:
        near = stream.read(_NEAR)
        stream.seek(max(0, size - 16 * _NEAR))
        if not near or _MARKS.search(near) or _MARKS.search(stream.read()):
            return True
    if signed := _SIGNED.fullmatch(near):
        return signed[1] == _checksum(signed[2])
    if content is not None and size == len(content) and path.read_bytes() == content:
        return True
    with suppress(OSError, AttributeError), path.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
        return os.getxattr(path, _ATTRIBUTE) == digest.encode()
    return False


def write_atomically(path: Path | str, data: bytes | str, *, updates: bool = False) -> Path:
    """Write `data` (text as UTF-8) to `path` in one step, replacing what was there.

    The bytes go to a new file in a temporary folder beside `path` and reach the disk before the
    name changes over, so neither a crash nor a second writer leaves half a file. Returns `path`.
    `updates` says that the file holds a state that was read from it and now goes on.

    Raises `AgonicError` where the folder is missing or cannot be written, or what is there has to
    stay (see `protect`).

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     write_atomically(folder + "/note.txt", "49 500 nT").read_text()
    '49 500 nT'
    """
    content = data.encode("utf-8", "backslashreplace") if isinstance(data, str) else data
    if updates and _protection is not None:
        _protection.written.add(os.path.realpath(path))
    with replacing(path, content) as fresh, fresh.open("xb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())
    return Path(path)


@contextmanager
def replacing(path: Path | str, content: bytes | None = None) -> Iterator[Path]:
    """A new file beside `path` that takes its place at the end of the block, whole.

    Raises as `write_atomically` does; `content` is what will be in it, where that is known.
    """
    check_target(path, content)
    target = Path(os.path.realpath(path))
    try:
        with temporary_folder(target.parent) as folder:
            fresh = folder / "new"
            yield fresh
            with suppress(FileNotFoundError):
                fresh.chmod(target.stat().st_mode)
            _sign(fresh)
            os.replace(fresh, target)
    except OSError as error:
        raise AgonicError(f"cannot write {path}: {_words(error)}") from error
    if _protection is not None:
        _protection.written.add(str(target))


def _sign(path: Path) -> None:
    """Keep the digest of a file with it, where the file system can."""
    with suppress(OSError, AttributeError), path.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
        os.setxattr(path, _ATTRIBUTE, digest.encode())


def sign_text(text: str) -> str:
    """A short text under a comment line that tells whether it was changed since.

    >>> sign_text("degrees = 2.7\\n").splitlines()[0]
    '# Written by agonic, checksum 9a591bd9'
    """
    return f"# Written by agonic, checksum {_checksum(text.encode()).decode()}\n{text}"


def _checksum(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest()[:8].encode()


def _words(error: OSError | ValueError) -> str:
    return str(getattr(error, "strerror", None) or error)


@contextmanager
def temporary_folder(parent: Path) -> Iterator[Path]:
    """A folder in `parent` that goes at the end; those of processes that were killed go first."""
    if parent not in _tidied:
        _tidied.add(parent)
        _remove_stale(parent)
    with TemporaryDirectory(prefix=f".agonic-{_HOST}-{os.getpid()}-", dir=parent) as folder:
        yield Path(folder)


def _remove_stale(parent: Path) -> None:
    """Remove the temporary folders that killed processes left behind."""
    with suppress(OSError), os.scandir(parent) as entries:
        left = [one for one in entries if one.name.startswith(".agonic-")]
        for one in left:
            if one.is_dir(follow_symlinks=False) and _is_stale(one):
                shutil.rmtree(one.path, ignore_errors=True)


def _is_stale(folder: os.DirEntry[str]) -> bool:
    """Whether the process that made a temporary folder is gone, or the folder a day old."""
    made = re.fullmatch(rf"\.agonic-{_HOST}-(\d+)-\w+", folder.name)
    if made is None or os.name != "posix":
        return time.time() - folder.stat(follow_symlinks=False).st_mtime > _STALE_S
    try:
        os.kill(int(made[1]), 0)
    except (ProcessLookupError, OverflowError):
        return True
    except OSError:
        return False
    return False


def make_folder(path: Path | str) -> Path:
    """The folder, made with its parents where it is not there; `AgonicError` where it cannot be."""
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise AgonicError(f"{path} is a file, and a folder is needed: give another name") from None
    except (OSError, ValueError) as error:
        raise AgonicError(f"cannot make the folder {path}: {_words(error)}") from error
    return Path(path)
