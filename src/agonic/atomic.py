"""Writing a file so that a reader sees the old one or the whole new one, never a part."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from agonic.errors import AgonicError


def write_atomically(path: Path | str, data: bytes | str) -> Path:
    """Write `data` (text as UTF-8) to `path` in one step, replacing what was there.

    The bytes go to a new file in a temporary folder beside `path` and reach the disk before the
    name changes over, so neither a crash nor a second writer leaves half a file. Returns `path`.

    Raises `AgonicError` where the folder is missing or cannot be written.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     write_atomically(folder + "/note.txt", "49 500 nT").read_text()
    '49 500 nT'
    """
    target = Path(os.path.realpath(path))
    if not target.parent.is_dir():
        raise AgonicError(f"cannot write {path}: there is no folder {target.parent}; create it")
    if target.exists() and not target.is_file():
        raise AgonicError(f"cannot write {path}: it is a folder or a device, not a file")
    content = data.encode() if isinstance(data, str) else data
    try:
        with TemporaryDirectory(prefix=".agonic-", dir=target.parent) as folder:
            fresh = Path(folder, target.name)
            with fresh.open("xb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            with suppress(FileNotFoundError):
                fresh.chmod(target.stat().st_mode)
            os.replace(fresh, target)
    except OSError as error:
        raise AgonicError(f"cannot write {path}: {error.strerror or error}") from error
    return Path(path)


def make_folder(path: Path | str) -> Path:
    """The folder, made with its parents where it is not there; `AgonicError` where it cannot be."""
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise AgonicError(f"cannot make the folder {path}: {error.strerror or error}") from error
    return Path(path)
