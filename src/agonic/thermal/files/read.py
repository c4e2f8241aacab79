"""`read_campaign`: the recordings of a climatic chamber, all sensors at all stations."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from agonic.errors import AgonicError, LogError
from agonic.thermal.campaign.description import Description, list_standard_stations
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.files.gather import GatheredFiles
from agonic.thermal.files.schema import FILE_NAME, name_columns, read_description
from agonic.thermal.files.split_table import read_recording
from agonic.thermal.files.station_files import StationFile, number_files

Progress = Callable[[str, float], None]
"""Told the name of a file and the share of all bytes read before it."""

_TABLES = {".csv", ".tsv", ".txt", ".parquet", ".pq", ".ulg", ".bin", ".log", ".npz", ".mat"}


def read_campaign(
    path: Path | str, *, unit: str | None = None, progress: Progress | None = None
) -> Campaign:
    """Everything that was recorded in a climatic chamber.

    Parameters
    ----------
    path : the folder with the recordings, its campaign.toml, or one file with a column `station`.
        Without a campaign.toml every table in the folder is read, a station is the number in the
        name of its file, or the column `station`, and the stations are the standard twelve. Several
        boards may have a file each, or one a station; the words in which the names of the files
        differ are theirs.
    unit : of the field, where neither the files nor the description say.
    progress : told the name of each file and the share of all bytes that were read before it.

    Returns a `Campaign`; its findings name files that are missing, damaged or cut, temperatures in
    kelvin, and sensors that are absent. Raises `LogError` where nothing can be used, and for a
    description with mistakes, all of them named.

    >>> from tempfile import TemporaryDirectory
    >>> row = "time_s,mag_x_uT,mag_y_uT,mag_z_uT,temperature_C\\n0,1,2,3,320\\n1,1,2,4,321\\n"
    >>> with TemporaryDirectory() as folder:
    ...     for number in (1, 2):
    ...         _ = Path(folder, f"pose{number}.csv").write_text(row)
    ...     campaign = read_campaign(folder)
    >>> campaign.stations, campaign.rows, [finding.name for finding in campaign.findings]
    ((1, 2), 4, ['kelvin'])
    """
    given = Path(path)
    description, files = _find_sources(given)
    gathered = GatheredFiles(description)
    common = _find_common_unit(description) or unit
    size = {one.path: one.path.stat().st_size for one in files}
    total, done = max(sum(size.values()), 1), 0
    for one in files:
        file = one.path
        if progress is not None:
            progress(file.name, done / total)
        try:
            names = name_columns(description, one.board)
            gathered.add(one, read_recording(file, common, names))
        except (AgonicError, OSError) as error:
            below = file != given and file.is_relative_to(given)
            name = file.relative_to(given) if below else file.name
            gathered.damaged.append(str(error).replace(str(file), str(name)))
        done += size[file]
    if progress is not None:
        progress("", 1.0)
    return gathered.campaign(given)


def _find_sources(path: Path) -> tuple[Description, list[StationFile]]:
    """What the campaign is about, and its files, each with its station and board if known."""
    if not path.exists():
        raise LogError("there is no such file or folder", path=path)
    described = path / FILE_NAME if path.is_dir() else path
    if described.suffix.lower() == ".toml" and described.is_file():
        description = read_description(described)
        files = _find_described_files(description, described.parent)
    else:
        description = Description(stations=list_standard_stations(), assumed=True)
        folder = path if path.is_dir() else path.parent
        files = number_files(_find_tables(path) if path.is_dir() else [path], folder)
    if not files:
        raise LogError("there are no recordings of stations in it", path=path)
    return description, files


def _find_described_files(description: Description, folder: Path) -> list[StationFile]:
    """The files that the description names and that are there."""
    own = [StationFile(s.number, "", folder / s.file) for s in description.stations if s.file]
    named = {one.station for one in own}
    pattern = description.files
    if "{" in pattern:
        rest = [n for n in description.numbers if n not in named]
        boards = list(dict.fromkeys(sensor.board for sensor in description.sensors))
        several = boards if "{board" in pattern else [""]
        own += [
            StationFile(n, board, folder / pattern.format(station=n, board=board))
            for n in (rest if "{station" in pattern else [None])
            for board in several
        ]
        return [one for one in own if one.path.is_file()]
    taken = {one.path for one in own}
    found = sorted(folder.glob(pattern)) if pattern else [] if own else _find_tables(folder)
    left = [file for file in found if file.is_file() and file not in taken]
    return [*own, *number_files(left, folder)]


def _find_tables(folder: Path) -> list[Path]:
    """The tables of a folder; those of its folders, one for each board, where it holds none."""
    own = sorted(f for f in folder.iterdir() if f.is_file() and f.suffix.lower() in _TABLES)
    below = (f for f in folder.glob("*/*") if f.is_file() and f.suffix.lower() in _TABLES)
    return own or sorted(below)


def _find_common_unit(description: Description) -> str | None:
    """The unit of the field where all sensors share one."""
    if not description.sensors:
        return description.unit
    units = {sensor.unit for sensor in description.sensors}
    return units.pop() if len(units) == 1 else None
