"""Folders and ZIP archives that hold one recording, a file for each sensor, as phones write them.

The tables are brought together by their times, as those of a bag are. What bare x, y and z are is
told by the name of their file: `Gyroscope.csv`, `mpu6050_accelerometer.mat`.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from zipfile import BadZipFile, ZipFile

from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.logs.contents import FOLDERS, check_declared
from agonic.logs.formats import FOLDER, HEAD_BYTES, JSON, MATLAB, TEXT, Format, format_of
from agonic.logs.groups import build_groups_log
from agonic.logs.headers.columns import identify_columns
from agonic.logs.headers.conventions import find_named_quantity
from agonic.logs.headers.header import identify_column
from agonic.logs.headers.quantities import FALLBACK
from agonic.logs.log import Log
from agonic.provenance import Input

_MOST_FILES = 64
_MOST_FIELDS = 4
_OFFICE = "[Content_Types].xml"
_BESIDE = ("acceleration", "rotation_rate")

Table = dict[str, NDArray[Any]]


def read(path: Path, source: Input, unit: str | None = None) -> Log:
    """The log that a folder or an archive is; `unit` is that of the field where none is named.

    Raises `LogError` where its files are not the sensors of one recording.
    """
    if path.is_dir():
        for name, what in FOLDERS.items():
            if (path / name).is_file():
                raise LogError(f"this is the folder of {what}")
        return _read_folder(path, path, source, unit)
    with TemporaryDirectory(prefix=".agonic-") as made:
        _unpack(path, Path(made))
        files = list(Path(made).iterdir())
        if len(files) == 1:
            return _read_alone(files[0], path, source, unit)
        return _read_folder(Path(made), path, source, unit)


def _read_alone(file: Path, path: Path, source: Input, unit: str | None) -> Log:
    """The log of the one file that an archive holds, of any kind but another archive."""
    with file.open("rb") as stream:
        kind = format_of(stream.read(HEAD_BYTES))
    if kind == FOLDER:
        raise LogError(f"an archive within an archive ({file.name}); unpack it")
    given = () if kind.unit_fixed else (unit,)
    log: Log = kind.reader.read(file, source, *given)
    return replace(log, path=path, notes=(f"from {file.name} in the archive", *log.notes))


def _read_folder(folder: Path, path: Path, source: Input, unit: str | None) -> Log:
    files = sorted(p for p in folder.iterdir() if p.is_file() and not p.name.startswith("."))
    if not files:
        raise LogError("there are no files in it; name a log")
    if len(files) > _MOST_FILES:
        raise LogError(_say_several(files, path))
    tables: dict[str, Table] = {}
    notes: list[str] = []
    for file in files:
        try:
            tables |= _read_tables(file, alone=len(files) == 1)
        except LogError as error:
            notes.append(f"{file.name} was not read: {error}")
    fields = [name for name, table in tables.items() if "field" in identify_columns(table)]
    if not fields:
        raise LogError(f"no file in it holds a magnetometer ({_list_files(files)})")
    if len(files) > 1 and not _is_one_recording(tables, fields):
        raise LogError(_say_several(files, path))
    return build_groups_log(
        tables,
        path=path,
        source=source,
        format="a file for each sensor",
        unit=unit,
        notes=tuple(notes),
        paths={name: Path(name) for name in tables},
    )


def _is_one_recording(tables: dict[str, Table], fields: list[str]) -> bool:
    """Whether what stands beside the magnetometers is in files of its own."""
    apart = any(identify_columns(table) for name, table in tables.items() if name not in fields)
    whole = any(q in identify_columns(tables[name]) for name in fields for q in _BESIDE)
    return apart and not whole and len(fields) <= _MOST_FIELDS


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


def _read_tables(file: Path, *, alone: bool) -> dict[str, Table]:
    """The tables in a file by its name; bare axes of another sensor get the name of that."""
    with file.open("rb") as stream:
        kind = format_of(stream.read(HEAD_BYTES))
    found = {}
    for number, table in enumerate(_read_kind(file, kind)):
        name = file.stem if not number else f"{file.stem} {number + 1}"
        named = name_axes(table, file.stem, alone=alone)
        if identify_columns(named):
            found[name] = named
    return found


def name_axes(table: Table, name: str, *, alone: bool) -> Table:
    """The columns of a file, a sheet or a table: bare axes under the sensor that it is named for.

    Where it is not `alone` and named for no magnetometer, bare axes are of something else.

    >>> list(name_axes({"t": None, "x": None}, "Gyroscope", alone=False))
    ['t', 'gyro x']
    """
    quantity = find_named_quantity(name)
    named = {_name_axis(header, quantity): values for header, values in table.items()}
    if alone or quantity == "field":
        return named
    return {header: values for header, values in named.items() if not _is_bare(header)}


def _read_kind(file: Path, kind: Format) -> list[Table]:
    """The columns that are understood in a file, a table for each clock."""
    if kind == TEXT:
        from agonic.logs.text.csv_text import read_table

        return [read_table(file)[0]]
    if kind == JSON:
        from agonic.logs.text.json_text import read_table as read_json

        return [read_json(file)[0]]
    if kind == MATLAB:
        from agonic.logs.arrays.matlab import read_tables

        return read_tables(file)
    raise LogError(f"{kind.name} are recordings of their own")


def _name_axis(header: str, quantity: str) -> str:
    """A header with bare axes under the name of the sensor that the file is named for."""
    if quantity not in _BESIDE:
        return header
    return f"{'acc' if quantity == _BESIDE[0] else 'gyro'} {header}" if _is_bare(header) else header


def _is_bare(header: str) -> bool:
    """Whether a header is x, y or z alone, perhaps with a unit."""
    column = identify_column(header)
    return column is not None and column.quantity.column == "field" and column.rank == FALLBACK


def _unpack(path: Path, folder: Path) -> None:
    """The files of an archive by their last names; folders in it, links and sizes do no harm."""
    try:
        with ZipFile(path) as archive:
            members = [m for m in archive.infolist() if m.file_size and m.filename[-1:] != "/"]
            if _OFFICE in archive.namelist():
                raise LogError("this is a workbook or a document; save the sheet as CSV")
            if len(members) > _MOST_FILES:
                raise LogError(f"{len(members)} files in it; unpack it and name one")
            check_declared(sum(m.file_size for m in members), path.stat().st_size)
            for member in members:
                name = Path(member.filename).name
                if name and not name.startswith(".") and "__MACOSX" not in member.filename:
                    _write(archive, member, folder / name[-100:])
    except (BadZipFile, EOFError, OSError, NotImplementedError, RuntimeError, zlib.error) as error:
        raise LogError(
            f"the archive cannot be unpacked ({error}); unpack it and name a file"
        ) from None


def _write(archive: ZipFile, member: Any, path: Path) -> None:
    with archive.open(member) as packed, path.open("wb") as plain:
        plain.write(packed.read(member.file_size))
