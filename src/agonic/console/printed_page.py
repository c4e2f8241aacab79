"""A page or plain text, as the name of the file asks for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path


def written_as_named(
    file: Path | None, what: str, *, page: Callable[[], str], text: Callable[[], str]
) -> list[str]:
    """The file that was written, .html or .txt; none where none was asked for."""
    from agonic.atomic import write_atomically
    from agonic.errors import AgonicError

    if file is None:
        return []
    if file.suffix.lower() in (".html", ".htm"):
        return [str(write_atomically(file, page()))]
    if file.suffix.lower() == ".txt":
        return [str(write_atomically(file, text() + "\n"))]
    raise AgonicError(f"{what} {file} is no kind of page; name it .html or .txt")
