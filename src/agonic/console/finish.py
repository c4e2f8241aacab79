"""How a command ends: its files are written, its result is said, and its exit status follows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from agonic.report.document import Document


PURPOSES = {
    ".html": "the report: open it in a browser",
    ".json": "the calibration: for agonic apply, verify, heading, export",
    ".toml": "the setup of the vehicle: for agonic heading",
    ".h": "for firmware: a C header with a self-test",
    ".param": "for ArduPilot: load it in a ground station, and restart",
    ".params": "for PX4: load it in a ground station, and restart",
    ".csv": "the readings",
}
"""What a file is for, by its ending."""
TOGETHER = {"compass": "for the autopilot, all compasses: load it in a ground station, and restart"}
"""What a file of all sensors is for, by its name."""
_NO_TEXT = (".html", ".htm", ".json", ".mat", ".ods", ".parquet", ".xlsx")


def finish(
    document: Document,
    *,
    out: Path | None = None,
    files: Sequence[Path | str] = (),
    report: Path | None = None,
    option: str = "--report",
    forms: Mapping[str, Callable[[], str]] | None = None,
    page: Path | None = None,
    as_json: bool = False,
    brief: bool = False,
    open_page: bool = False,
) -> int:
    """Save the calibration, write the report, say the result, and return the exit status.

    The document's calibration is saved to `out`, unless it is refused; a folder gets it under the
    sensor's name, and the report beside it. `files` are written already.
    `option` is the one that `report` was given by, `forms` what it may be beside a page and text,
    by the ending of its name. `page` is a report that is written already, and
    that the documents of the sensors have among their files; `open_page` shows it in a browser.
    `brief` leaves out what only `--verbose` says. The status is 0 where nothing is objected to.
    """
    from agonic.console.output import print_json, say
    from agonic.console.terminal import find_width
    from agonic.files.calibration import save
    from agonic.report.text import wrap_command

    calibration = None if document.verdict == "refused" else document.calibration
    if out is not None and is_folder(out):
        out.mkdir(parents=True, exist_ok=True)
        report, out = report or out / "report.html", out / f"{document.name or 'mag'}.json"
    written = [] if out is None or calibration is None else [str(save(calibration, out))]
    written += map(str, files)
    if report is not None:
        made = {".html": document.to_html, ".txt": lambda: document.to_text() + "\n"}
        made |= forms or {}
        written.append(write_as_named(report, option, made))
    if as_json:
        own = {} if page is not None else {"files": written}
        print_json(document.schema, document.to_record() | own)
    else:
        width = find_width()
        say(replace(document, next_step="").to_text(width, brief=brief))
        files = list_files(document, page)
        if files:
            say("\n" + "\n".join(describe_files(files, width)))
        elif written:
            say(f"\nWritten   {', '.join(written)}")
        elif document.calibration is not None or document.sensors:
            say("\nNothing was written.")
        if document.next_step:
            say("\n" + wrap_command(document.next_step, width=width, label="Next      "))
    if open_page and page is not None:
        show_in_browser(page)
    return 0 if document.good else 1


def is_folder(out: Path) -> bool:
    """Whether files go into it: a folder that is there, or a name without an ending."""
    return out.is_dir() or not out.suffix


def list_files(document: Document, page: Path | None) -> list[Path]:
    """Every file that was written for the sensors of a document, the page first, each once."""
    if page is None:
        return []
    of_sensors = [
        Path(file)
        for sensor in document.sensors
        for file in (sensor.values or {}).get("files") or ()
        if Path(file) != page
    ]
    return [page, *dict.fromkeys(of_sensors)]


def describe_files(files: Sequence[Path], width: int) -> list[str]:
    """The files of a folder, a line for all that are for the same, with what that is; those of
    single sensors that one file holds together are left out."""
    from agonic.report.text import wrap, wrap_entries

    alike: dict[str, list[str]] = {}
    of_all = {file.suffix for file in files if file.stem in TOGETHER}
    for file in files:
        purpose = TOGETHER.get(file.stem) or PURPOSES.get(file.suffix, "") or "beside the others"
        if file.stem in TOGETHER or file.suffix not in of_all:
            alike.setdefault(purpose, []).append(file.name)
    described = {
        names[0]: purpose + (f" ({len(names)} files, one a sensor)" if len(names) > 1 else "")
        for purpose, names in alike.items()
    }
    head = wrap(f"Written to {files[0].parent}:", width=width, indent="")
    return [head, *wrap_entries(described, width=width)]


def show_in_browser(page: Path) -> None:
    """Open a page in the browser; where there is none, that is told."""
    import sys
    import webbrowser

    if not webbrowser.open(page.resolve().as_uri()):
        print(f"agonic: no browser could be opened; the page is {page}", file=sys.stderr)


def require_table(out: Path) -> None:
    """Refuse the name of a page or of a binary file for what will be a table of text."""
    from agonic.atomic import check_target
    from agonic.errors import AgonicError

    check_target(out)  # what must not be replaced under any name is the first thing to know
    if out.suffix.lower() in _NO_TEXT:
        raise AgonicError(f"-o {out} would be a text table; name it .csv")


def write_as_named(file: Path, option: str, made: Mapping[str, Callable[[], str]]) -> str:
    """Write a file in the form that its name asks for, and return its name. `made` gives the
    content for each ending; `option` names the file on the command line."""
    from agonic.atomic import write_atomically
    from agonic.errors import AgonicError

    ending = file.suffix.lower()
    make = made.get(".html" if ending == ".htm" else ending)
    if make is None:
        *others, last = made
        named = f"{', '.join(others)} or {last}"
        raise AgonicError(f"{option} {file} is not a type written here; name it {named}")
    return str(write_atomically(file, make()))
