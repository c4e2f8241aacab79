"""`read_campaign`: the recordings of a climatic chamber, all sensors at all stations."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from agonic.errors import AgonicError, LogError
from agonic.health import Finding
from agonic.provenance import Input
from agonic.samples import Samples
from agonic.thermal.campaign.description import Description
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.campaign.sensors import Sensor
from agonic.thermal.campaign.standard import list_standard_stations
from agonic.thermal.files.large_tables import RecordedFile, read_recording
from agonic.thermal.files.schema import FILE_NAME, read_description
from agonic.thermal.files.split_table import Part
from agonic.thermal.names import name_stations
from agonic.units import RAW, nanotesla_per

Progress = Callable[[str, float], None]
"""Told the name of a file and the share of all bytes read before it."""

_TABLES = {".csv", ".tsv", ".txt", ".parquet", ".pq", ".ulg", ".bin", ".log", ".npz", ".mat"}
_NUMBER = re.compile(r"\d+")


def read_campaign(path: Path | str, *, progress: Progress | None = None) -> Campaign:
    """Everything that was recorded in a climatic chamber.

    Parameters
    ----------
    path : the folder with the recordings, its campaign.toml, or one file with a column `station`.
        Without a campaign.toml every table in the folder is read, a station is the number in the
        name of its file, or the column `station`, and the stations are the standard twelve.
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
    gathered = _CampaignReader(description)
    size = {file: file.stat().st_size for _, file in files}
    total, done = max(sum(size.values()), 1), 0
    for number, file in files:
        if progress is not None:
            progress(file.name, done / total)
        try:
            gathered.add(number, file, read_recording(file, _find_common_unit(description)))
        except (AgonicError, OSError) as error:
            gathered.damaged.append(str(error).replace(str(file), file.name))
        done += size[file]
    if progress is not None:
        progress("", 1.0)
    return gathered.campaign(given)


def _find_sources(path: Path) -> tuple[Description, list[tuple[int | None, Path]]]:
    """What the campaign is about, and its files, each with the number of its station if known."""
    if not path.exists():
        raise LogError("there is no such file or folder", path=path)
    described = path / FILE_NAME if path.is_dir() else path
    if described.suffix.lower() == ".toml" and described.is_file():
        description = read_description(described)
        files = _find_described_files(description, described.parent)
    else:
        description = Description(stations=list_standard_stations())
        files = _number_files(_find_tables(path) if path.is_dir() else [path])
    if not files:
        raise LogError("there are no recordings of stations in it", path=path)
    return description, files


def _find_described_files(description: Description, folder: Path) -> list[tuple[int | None, Path]]:
    """The files that the description names and that are there."""
    own = [(s.number, folder / s.file) for s in description.stations if s.file]
    named = {number for number, _ in own}
    pattern = description.files
    if "{" in pattern:
        rest = [n for n in description.numbers if n not in named]
        own += [(n, folder / pattern.format(station=n)) for n in rest]
        return [(n, file) for n, file in own if file.is_file()]
    taken = {file for _, file in own}
    found = sorted(folder.glob(pattern)) if pattern else [] if own else _find_tables(folder)
    return [*own, *_number_files([file for file in found if file.is_file() and file not in taken])]


def _find_tables(folder: Path) -> list[Path]:
    return sorted(f for f in folder.iterdir() if f.is_file() and f.suffix.lower() in _TABLES)


def _number_files(files: Sequence[Path]) -> list[tuple[int | None, Path]]:
    """The files with the number in which their names differ."""
    numbers = [[int(n) for n in _NUMBER.findall(file.stem)] for file in files]
    if len({len(own) for own in numbers}) == 1:
        for column in zip(*numbers, strict=True):
            if len(set(column)) == len(files):
                return sorted(zip(column, files, strict=True))
    return [(None, file) for file in files]


def _find_common_unit(description: Description) -> str | None:
    """The unit of the field where all sensors share one."""
    units = {sensor.unit for sensor in description.sensors}
    return units.pop() if len(units) == 1 else None


@dataclass
class _CampaignReader:
    """What has been read so far, and what was wrong with it."""

    description: Description
    recordings: dict[str, dict[int, Samples]] = field(default_factory=dict)
    inputs: list[Input] = field(default_factory=list)
    damaged: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    kelvin: dict[str, set[int]] = field(default_factory=lambda: defaultdict(set))
    absent: dict[str, set[int]] = field(default_factory=lambda: defaultdict(set))
    unnumbered: list[str] = field(default_factory=list)
    surplus: set[int] = field(default_factory=set)
    twice: dict[str, set[int]] = field(default_factory=lambda: defaultdict(set))

    def add(self, number: int | None, file: Path, recorded: RecordedFile) -> None:
        """Take in a file, which may hold one station or all."""
        self.inputs.append(recorded.source)
        self.notes += [f"{file.name}: {note}" for note in recorded.notes]
        for part in recorded.parts:
            station = part.station if part.station is not None else number
            if station is None:
                self.unnumbered.append(file.name)
                continue
            self.damaged += [f"{file.name}: {failure}" for failure in part.failures]
            if self.description.stations and station not in self.description.numbers:
                self.surplus.add(station)
                continue
            self._take(station, part)

    def _take(self, station: int, part: Part) -> None:
        """The sensors of a station that were asked for."""
        wanted = self.description.sensors or [Sensor(name=name) for name in part.sensors]
        chosen = {sensor.name: _choose(sensor, part.sensors) for sensor in wanted}
        for sensor in wanted:
            samples = chosen[sensor.name]
            if samples is None:
                self.absent[sensor.name].add(station)
                continue
            if sensor.temperature_of:
                samples = _take_temperature_of(samples, chosen.get(sensor.temperature_of))
            if part.kelvin:
                self.kelvin[sensor.name].add(station)
            if station in self.recordings.get(sensor.name, {}):
                self.twice[sensor.name].add(station)
                continue
            named = _convert_unit(samples, sensor.unit).with_columns(name=sensor.name)
            self.recordings.setdefault(sensor.name, {})[station] = named

    def campaign(self, path: Path) -> Campaign:
        """The campaign that was read."""
        if not self.recordings:
            said = "; ".join(self.damaged[:3]) or (
                f"the station of {', '.join(self.unnumbered[:3])} is not known: number the files, "
                "or give them a column station"
                if self.unnumbered
                else "no sensor of the description is in the files"
            )
            raise LogError(said, path=path)
        return Campaign(
            recordings={name: dict(sorted(by.items())) for name, by in self.recordings.items()},
            description=self._described(),
            inputs=tuple(self.inputs),
            findings=tuple(self._findings()),
        )

    def _described(self) -> Description:
        """The description, its sensors those that were found where it names none."""
        if self.description.sensors:
            return self.description
        return replace(
            self.description, sensors=tuple(Sensor(name=name) for name in self.recordings)
        )

    def _findings(self) -> list[Finding]:
        """What was wrong with the files."""
        damaged = [
            Finding("damaged file", "check", text, "the rest is used; record it again if you can")
            for text in self.damaged
        ]
        found = []
        if self.kelvin:
            what = f"temperatures of {_name_sensors(self.kelvin)} are in kelvin although nothing "
            what += "says so: 273.15 was taken off"
            found.append(Finding("kelvin", "check", what, "name the column temperature_K"))
        if self.absent:
            what = f"there are no readings of {_name_sensors(self.absent)}"
            move = f"compare the names in {FILE_NAME} with the files (agonic info FILE)"
            found.append(Finding("absent sensor", "check", what, move))
        if self.twice:
            what = f"two files have readings of {_name_sensors(self.twice)}; the first was taken"
            move = "give the sensors of each board names of their own, or each board a folder"
            found.append(Finding("sensor twice", "check", what, move))
        if self.unnumbered:
            what = f"{', '.join(self.unnumbered)}: which station it is cannot be told; left out"
            move = "number the files, or give them a column station"
            found.append(Finding("unknown station", "check", what, move))
        if self.surplus:
            what = f"{name_stations(self.surplus)} in the files is not described; left out"
            found.append(Finding("unknown station", "check", what, f"describe it in {FILE_NAME}"))
        return [*damaged, *found, *(Finding("reader's note", "note", note) for note in self.notes)]


def _name_sensors(where: Mapping[str, set[int]]) -> str:
    """Sensors, and the stations where not all are alike."""
    groups: dict[tuple[int, ...], list[str]] = {}
    for name, numbers in where.items():
        groups.setdefault(tuple(sorted(numbers)), []).append(name)
    return "; ".join(
        f"{', '.join(names)} at {name_stations(numbers)}" for numbers, names in groups.items()
    )


def _choose(sensor: Sensor, found: Mapping[str, Samples]) -> Samples | None:
    """The readings of a sensor, by its column or name; the only ones there are where neither is."""
    for name in filter(None, (sensor.column, sensor.name)):
        if name in found:
            return found[name]
    return None


def _convert_unit(samples: Samples, unit: str | None) -> Samples:
    """The readings in nT where their unit was given only in the description."""
    if samples.unit != RAW or unit is None:
        return samples
    factor = nanotesla_per(unit)
    if factor == 1.0 and unit.lower() == RAW:
        return samples
    return samples.with_columns(field=samples.field * factor, unit="nT")


def _take_temperature_of(samples: Samples, other: Samples | None) -> Samples:
    """The readings with the temperature of another sensor at their moments."""
    if other is None or other.temperature is None:
        return samples
    if samples.time is None or other.time is None:
        same = len(samples) == len(other)
        return samples.with_columns(temperature=other.temperature) if same else samples
    return samples.with_columns(temperature=np.interp(samples.time, other.time, other.temperature))
