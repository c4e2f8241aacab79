"""Folders and ZIP archives that hold one recording, a file for each sensor, as phones write them:
brought together by their times. Bare x, y and z are what their file is named for: `Gyroscope.csv`.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from zipfile import BadZipFile, ZipFile

from agonic.errors import LogError
from agonic.logs.contents import MOST_PARTS, check_declared
from agonic.logs.formats import FOLDER, KINDS, format_of, read_head
from agonic.logs.groups import INERTIAL, build_groups_log, name_axes, read_file
from agonic.logs.headers.columns import identify_columns
from agonic.logs.log import Log, Table
from agonic.provenance import Input

_TABLES = ("text.", "arrays.", "parquet", "workbook")
"""Modules of what may hold one sensor of several; other files are recordings of their own."""


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that a folder or an archive is; `unit` is that of the field where none is named."""
    if path.is_dir():
        for name, what in KINDS["folders"].items():
            if (path / name).is_file():
                raise LogError(f"this is the folder of {what}")
        return _read_folder(path, path, source, unit)
    with TemporaryDirectory(prefix=".agonic-") as made:
        _unpack(path, Path(made))
        files = list(Path(made).iterdir())
        if len(files) != 1:
            return _read_folder(Path(made), path, source, unit)
        kind = format_of(read_head(files[0]))
        if kind == FOLDER:
            raise LogError(f"an archive within an archive ({files[0].name}); unpack it")
        log = read_file(kind, files[0], source, unit)
        return replace(log, path=path, notes=(f"from {files[0].name} in the archive", *log.notes))


def _read_folder(folder: Path, path: Path, source: Input, unit: str | None) -> Log:
    files = sorted(p for p in folder.iterdir() if p.is_file() and not p.name.startswith("."))
    if not files:
        raise LogError("there are no files in it; name a log")
    if len(files) > MOST_PARTS:
        raise LogError(_say_several(files, path))
    tables: dict[str, Table] = {}
    corrected: dict[str, str] = {}
    notes: list[str] = []
    for file in files:
        try:
            kind = format_of(read_head(file))
            if not kind.module.startswith(_TABLES):
                raise LogError(f"{kind.name} are recordings of their own")
            read = kind.reader.read_tables(file)
            for part, table in read.tables.items():
                named = name_axes(table, file.stem, alone=len(files) == 1)
                if identify_columns(named):
                    number = part + 1 if isinstance(part, int) else part
                    name = f"{file.stem} {number}".rstrip() if part else file.stem
                    tables[name], corrected[name] = named, read.corrected.get(str(part), "")
        except LogError as error:
            notes.append(f"{file.name} was not read: {error}")
    found = {name: identify_columns(table) for name, table in tables.items()}
    fields = [name for name in found if "field" in found[name]]
    if not fields:
        raise LogError(f"no file in it holds a magnetometer ({_list_files(files)})")
    # one recording: what stands beside the magnetometers is in files of its own
    apart = len(found) > len(fields) and not any(found[n].keys() & INERTIAL for n in fields)
    if len(files) > 1 and not (apart and len(fields) < 5):
        raise LogError(_say_several(files, path))
    paths = {name: Path(name) for name in tables}
    format = "a file for each sensor"
    return build_groups_log(
        tables,
        paths,
        corrected=corrected,
        path=path,
        source=source,
        format=format,
        unit=unit,
        notes=tuple(notes),
    )


def _say_several(files: list[Path], path: Path) -> str:
    """What a folder or an archive of recordings is, and what to do with it."""
    what, do = ("a folder", "") if path.is_dir() else ("an archive", "unpack it, then ")
    return (
        f"this is {what} of {len(files)} files ({_list_files(files)}) that are not one recording; "
        f"{do}name one of them, or give the folder to agonic fleet where each is one of its own"
    )


def _list_files(files: Iterable[Path]) -> str:
    names = [file.name for file in files]
    return ", ".join(names[:5]) + (", …" if len(names) > 5 else "")


def _unpack(path: Path, folder: Path) -> None:
    """The files of an archive by their last names; folders in it, links and sizes do no harm."""
    try:
        with ZipFile(path) as archive:
            members = [m for m in archive.infolist() if m.file_size and m.filename[-1:] != "/"]
            if "[Content_Types].xml" in archive.namelist():
                raise LogError("this is a workbook or a document; save the sheet as CSV")
            if len(members) > MOST_PARTS:
                raise LogError(f"{len(members)} files in it; unpack it and name one")
            check_declared(sum(m.file_size for m in members), path.stat().st_size)
            for member in members:
                name = Path(member.filename).name
                if name and not name.startswith(".") and "__MACOSX" not in member.filename:
                    with archive.open(member) as packed:
                        (folder / name[-100:]).write_bytes(packed.read(member.file_size))
    except (BadZipFile, EOFError, OSError, NotImplementedError, RuntimeError, zlib.error) as error:
        raise LogError(
            f"the archive cannot be unpacked ({error}); unpack it and name a file"
        ) from None
