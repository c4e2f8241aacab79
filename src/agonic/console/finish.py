"""How a command ends: its files are written, its result is said, and its exit status follows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from agonic.report.document import Document


def finish(
    document: Document,
    *,
    out: Path | None = None,
    files: Sequence[Path | str] = (),
    report: Path | None = None,
    option: str = "--report",
    page: Path | None = None,
    as_json: bool = False,
) -> int:
    """Save the calibration, write the report, say the result, and return the exit status.

    The document's calibration is saved to `out`, unless it is refused. `files` are written already.
    `option` is the one that `report` was given by. `page` is a report that is written already, and
    that the documents of the sensors have among their files. The status is 0 where nothing is
    objected to.
    """
    from agonic.console.output import print_json, say
    from agonic.files.calibration import save

    calibration = None if document.verdict == "refused" else document.calibration
    written = [] if out is None or calibration is None else [str(save(calibration, out))]
    written += map(str, files)
    if report is not None:
        made = {".html": document.to_html, ".txt": lambda: document.to_text() + "\n"}
        written.append(write_as_named(report, option, made))
    if as_json:
        own = {} if page is not None else {"files": written}
        print_json(document.schema, document.to_record() | own)
    else:
        say(document.to_text())
        if page is not None:
            say(f"\nReport    {page}")
        elif written:
            say(f"\nWritten   {', '.join(written)}")
        elif document.calibration is not None or document.sensors:
            say("\nNothing was written.")
    return 0 if document.good else 1


def write_as_named(file: Path, option: str, made: Mapping[str, Callable[[], str]]) -> str:
    """Write a file in the form that its name asks for, and return its name.

    `made` gives the content for each ending; `option` names the file on the command line.
    """
    from agonic.atomic import write_atomically
    from agonic.errors import AgonicError

    ending = file.suffix.lower()
    make = made.get(".html" if ending == ".htm" else ending)
    if make is None:
        *others, last = made
        named = f"{', '.join(others)} or {last}"
        raise AgonicError(f"{option} {file} is no kind of page; name it {named}")
    return str(write_atomically(file, make()))
