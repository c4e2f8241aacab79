"""`Inputs`: the logs that folders, patterns and files name."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from glob import glob, has_magic
from pathlib import Path

from agonic.errors import AgonicError, LogError
from agonic.fleet.settings import FleetSettings
from agonic.logs.formats import name_own_table
from agonic.logs.large.dataset import Dataset, find_dataset
from agonic.logs.read import accepts
from agonic.logs.remote import is_remote, list_remote
from agonic.population import Row
from agonic.provenance import escape_text

LOG_SUFFIXES = frozenset(
    (".csv", ".tsv", ".ulg", ".bin", ".tlog", ".parquet", ".mat", ".npz", ".cdf", ".nc")
)
"""In a folder, a file that ends so is a log: where it cannot be read, that is worth a row."""
PARQUET = ".parquet"
JOURNAL, TABLE, PAGE, SINGLE = "journal.sqlite", "fleet.parquet", "report.html", "calibrations"
"""The files of a fleet, and the folder of what is written of single logs."""
RESULTS = (JOURNAL, f"{JOURNAL}-journal", TABLE, PAGE, SINGLE)
"""No logs, where a journal or both table and page are among them."""


@dataclass(frozen=True, slots=True)
class Inputs:
    """The logs that were named, each once, in order of their paths, and datasets of many sensors.
    `perhaps` are texts in folders that are logs only if they hold a magnetometer; `skipped` is how
    many files of folders no reader knows."""

    logs: tuple[str, ...]
    datasets: tuple[Dataset, ...] = ()
    perhaps: frozenset[str] = frozenset()
    skipped: int = 0

    def __len__(self) -> int:
        return len(self.logs) + len(self.datasets)


def find_inputs(named: Iterable[Path | str], settings: FleetSettings | None = None) -> Inputs:
    """The logs and datasets that files, folders (with all that is in them) and patterns name."""
    asked = settings or FleetSettings()
    datasets: dict[str, Dataset] = {}
    explicit: dict[str, str] = {}
    within: dict[str, str] = {}
    perhaps: set[str] = set()
    skipped = 0
    for path in (path for name in named for path in _expand(os.fspath(name))):
        if is_remote(path):
            explicit.setdefault(path, path)
        elif os.path.isdir(path):
            files = list(_list_files(path))
            tables = [file for file in files if file.suffix.lower() == PARQUET]
            datasets |= {
                os.path.abspath(d.path): d for d in _find_datasets(Path(path), tables, asked)
            }
            for file in files:
                known = file.suffix.lower() in LOG_SUFFIXES
                if _is_own_table(file) if known else not accepts(file):
                    skipped += 1
                    continue
                within.setdefault(os.path.abspath(file), str(file))
                if not known:
                    perhaps.add(str(file))
        else:
            explicit.setdefault(os.path.abspath(path), path)
            if Path(path).suffix.lower() == PARQUET and (found := _open_dataset(Path(path), asked)):
                datasets.setdefault(os.path.abspath(path), found)
    parts = {os.path.abspath(file) for d in datasets.values() for file in _list_parts(d)}
    logs = sorted(path for key, path in {**within, **explicit}.items() if key not in parts)
    if not logs and not datasets:
        raise AgonicError("the inputs hold no log: name files, folders, or patterns in quotes")
    return Inputs(
        logs=tuple(logs),
        datasets=tuple(datasets[key] for key in sorted(datasets)),
        perhaps=frozenset(perhaps.difference(explicit.values())),
        skipped=skipped,
    )


def _is_own_table(file: Path) -> bool:
    """Whether a table is agonic's own, of other things than readings, by its headers; or the truth
    beside logs, whoever wrote it."""
    if file.suffix.lower() != ".csv":
        return False
    if file.stem.lower().endswith("truth"):
        return True
    with suppress(OSError), file.open(encoding="utf-8", errors="replace") as stream:
        return bool(name_own_table(stream.readline(4096).strip().split(",")))
    return False


def _find_datasets(folder: Path, tables: Sequence[Path], asked: FleetSettings) -> Iterator[Dataset]:
    """The datasets among the Parquet tables of a folder: all of them as one, or by folder, or file.
    Folders named `key=value` are parts of the one above them."""
    if not tables:
        return
    whole = _open_dataset(folder, asked, tables)
    if whole is not None:
        yield whole
        return
    by_folder: dict[Path, list[Path]] = {}
    for table in tables:
        above = next((p for p in table.parents if "=" not in p.name), table.parent)
        by_folder.setdefault(above, []).append(table)
    if list(by_folder) != [folder]:
        for below, some in by_folder.items():
            if below != folder:
                yield from _find_datasets(below, some, asked)
    for table in by_folder.get(folder, []):
        if found := _open_dataset(table, asked):
            yield found


def _open_dataset(
    path: Path, asked: FleetSettings, tables: Sequence[Path] | None = None
) -> Dataset | None:
    """The dataset that a file or a folder is; one that cannot be is read file by file, as logs."""
    files = None if tables is None else [str(table) for table in tables]
    try:
        found = find_dataset(path, asked.sensor_column, unit=asked.unit, files=files)
    except (LogError, OSError):
        return None
    return None if found and asked.sensor_column is None and _is_of_vehicles(found) else found


def _is_of_vehicles(dataset: Dataset) -> bool:
    """Whether the sensors have such names as those of one vehicle, in each file: mag0, MAG2."""
    from pyarrow.parquet import read_metadata

    for file in dataset.files:
        footer = read_metadata(file)
        if dataset.sensor not in footer.schema.names:
            return False
        of_sensor = footer.schema.names.index(dataset.sensor)
        for group in range(footer.num_row_groups):
            known = footer.row_group(group).column(of_sensor).statistics
            ends = (known.min, known.max) if known is not None and known.has_min_max else (None,)
            if not all(isinstance(end, str) and _OF_VEHICLE.fullmatch(end) for end in ends):
                return False
    return True


_OF_VEHICLE = re.compile(r"(sensor_)?(mag|compass|magnetometer)[ _]?\[?\d?\]?", re.IGNORECASE)


def _list_parts(dataset: Dataset) -> Iterator[str]:
    yield from dataset.files
    yield from (file for file, _ in dataset.damaged)


def name_sensors(path: str, rows: Sequence[Row], pattern: str | None) -> list[Row]:
    """The rows of a log, with the sensor and the path that they are known by.

    A sensor is its number for autopilots where the log knows it, else the stem of the file, with
    the channel where the log has several. A `pattern` takes it from the path: by its group named
    `sensor`, its first group, or all of it.
    """
    path = escape_text(path)
    named = None if pattern is None else _get_group(re.search(pattern, path))
    ids = [row.device_id for row in rows]

    def sensor(row: Row) -> str:
        if named is None and row.device_id is not None and ids.count(row.device_id) == 1:
            return str(row.device_id)
        stem = named or Path(path).stem
        return f"{stem} {row.channel}" if len(rows) > 1 else stem

    return [replace(row, sensor=sensor(row), source=path) for row in rows]


def _get_group(match: re.Match[str] | None) -> str | None:
    if match is None:
        return None
    named = match.groupdict().get("sensor")
    return named or next((group for group in match.groups() if group), match[0]) or None


def _expand(name: str) -> list[str]:
    """The files and folders that a name, which may be a pattern, stands for."""
    if is_remote(name):
        return _expand_remote(name)
    if os.path.lexists(name):
        return [name]
    if not has_magic(name):
        raise AgonicError(f"{name}: there is no such file or folder")
    found = sorted(glob(name, recursive=True))
    if not found:
        raise AgonicError(f"{name}: no file matches this pattern")
    return found


def _expand_remote(url: str) -> list[str]:
    """The logs in object storage that a URL, a folder or a pattern with stars, names."""
    if "*" not in url:
        found = list_remote(url)
        named = len(found) == 1 and found[0].url == url
        return [file.url for file in found if named or file.suffix.lower() in LOG_SUFFIXES]
    folder, mark, asked = url.partition("?")
    below = folder.partition("*")[0].rpartition("/")[0]
    found = list_remote(f"{below}{mark}{asked}")
    return [file.url for file in found if fnmatchcase(file.url.partition("?")[0], folder)]


def _list_files(folder: str) -> Iterator[Path]:
    """All files in a folder and those below, but for hidden ones and results of a fleet."""
    for base, below, files in os.walk(folder):
        results = RESULTS if JOURNAL in files or {TABLE, PAGE} <= set(files) else ()
        below[:] = sorted(n for n in below if not n.startswith(".") and n not in results)
        for name in files:
            path = Path(base, name)
            if not name.startswith(".") and name not in results and path.is_file():
                yield path
