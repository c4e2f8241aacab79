"""The files of a campaign put together: which sensor of which board, and what was wrong."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np

from agonic.errors import LogError
from agonic.health import Finding
from agonic.logs.headers.columns import identify_column
from agonic.provenance import Input
from agonic.samples import Samples
from agonic.thermal.campaign.description import Description, Sensor, Station, name_stations
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.files.schema import FILE_NAME, find_label
from agonic.thermal.files.split_table import Part, RecordedFile
from agonic.thermal.files.station_files import StationFile
from agonic.units import RAW, nanotesla_per

Place = tuple[int, str]
"""Which of the files of a station, and the name of a sensor in it."""


def choose_readings(
    sensor: Sensor,
    files: Sequence[tuple[str, Mapping[str, Samples]]],
    sensors: Sequence[Sensor],
) -> list[Place]:
    """Where the readings of a sensor are: by its board, and its column or name.

    Parameters: of every file of a station the board and the sensors in it, and all sensors that
    are described. Where neither column nor name is there, the only sensor of the only file of the
    board, or of all, is taken if no other is described for it.
    """
    named = [
        k
        for k, (board, _) in enumerate(files)
        if (bool(sensor.board) and board.casefold() == sensor.board.casefold())
    ]
    mine = named or list(range(len(files)))
    label = find_label(sensor, sensors)
    for wanted in dict.fromkeys(filter(None, (label, _find_owner(sensor.column), sensor.name))):
        if found := [(k, wanted) for k in mine if wanted in files[k][1]]:
            return found
    alone = [other for other in sensors if other.board == sensor.board] == [sensor]
    lone = len(mine) == 1 and len(files[mine[0]][1]) == 1 and (named or len(sensors) == 1)
    if alone and lone and not label:
        return [(mine[0], next(iter(files[mine[0]][1])))]
    return []


def _find_owner(header: str) -> str:
    """The name of the sensor to which a column of the field belongs: mag2 of mag2_x_uT."""
    column = identify_column(header)
    if column is None or column.quantity.column != "field":
        return ""
    numbered = column.sensor.isdecimal() or not column.sensor
    return f"mag{column.sensor}" if numbered else column.sensor


def convert_unit(samples: Samples, unit: str | None) -> Samples:
    """The readings in nT where their unit was given only in the description."""
    if samples.unit != RAW or unit is None:
        return samples
    factor = nanotesla_per(unit)
    if factor == 1.0 and unit.lower() == RAW:
        return samples
    return samples.with_columns(field=samples.field * factor, unit="nT")


def take_temperature_of(samples: Samples, other: Samples | None) -> Samples:
    """The readings with the temperature of another sensor at their moments."""
    if other is None or other.temperature is None:
        return samples
    if samples.time is None or other.time is None:
        same = len(samples) == len(other)
        return samples.with_columns(temperature=other.temperature) if same else samples
    return samples.with_columns(temperature=np.interp(samples.time, other.time, other.temperature))


def align_clocks(
    recordings: Mapping[str, Mapping[int, Samples]],
) -> tuple[dict[str, dict[int, Samples]], bool]:
    """The recordings, with clocks from zero where those of sensors at one station lie apart.

    Boards count from when they were switched on, or by another calendar. Returns also whether
    clocks were set.
    """
    spans: defaultdict[int, list[tuple[float, float]]] = defaultdict(list)
    for by in recordings.values():
        for number, samples in by.items():
            if samples.time is not None:
                epoch = 0.0 if samples.epoch is None else samples.epoch.timestamp()
                low, high = float(samples.time[0]), float(samples.time[-1])
                spans[number].append((low + epoch, high + epoch))
    apart = [max(a for a, _ in own) > min(b for _, b in own) for own in spans.values()]
    if not apart or not all(apart):
        return {name: dict(by) for name, by in recordings.items()}, False
    return {
        name: {number: _begin_at_zero(samples) for number, samples in by.items()}
        for name, by in recordings.items()
    }, True


def _begin_at_zero(samples: Samples) -> Samples:
    if samples.time is None:
        return samples
    return samples.with_columns(time=samples.time - samples.time[0], epoch=None)


_SHARE = 0.5
"""Of its stations a board must have in common with another, to stand beside it."""


class StationPart(NamedTuple):
    """What a file holds of a station, and the board that the file's name tells."""

    station: int
    board: str
    file: Path
    part: Part


@dataclass
class GatheredFiles:
    """What has been read so far, and what was wrong with it."""

    description: Description
    parts: list[StationPart] = field(default_factory=list)
    recordings: dict[str, dict[int, Samples]] = field(default_factory=dict)
    restarts: dict[str, dict[int, tuple[float, ...]]] = field(default_factory=dict)
    inputs: list[Input] = field(default_factory=list)
    damaged: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    kelvin: dict[str, set[int]] = field(default_factory=lambda: defaultdict(set))
    absent: dict[str, set[int]] = field(default_factory=lambda: defaultdict(set))
    unnumbered: list[str] = field(default_factory=list)
    surplus: set[int] = field(default_factory=set)
    twice: dict[str, set[int]] = field(default_factory=lambda: defaultdict(set))
    renamed: dict[str, str] = field(default_factory=dict)

    def add(self, source: StationFile, recorded: RecordedFile) -> None:
        """Take in a file, which may hold one station or all."""
        file = source.path
        self.inputs.append(recorded.source)
        self.notes += [f"{file.name}: {note}" for note in recorded.notes]
        for part in recorded.parts:
            station = part.station if part.station is not None else source.station
            if station is None:
                self.unnumbered.append(file.name)
                continue
            self.damaged += [f"{file.name}: {failure}" for failure in part.failures]
            described = self.description.stations and not self.description.assumed
            if described and station not in self.description.numbers:
                self.surplus.add(station)
                continue
            own = "" if part.station is None else file.stem
            self.parts.append(StationPart(station, source.board or own, file, part))

    def campaign(self, path: Path) -> Campaign:
        """The campaign that was read."""
        boards = _find_boards(self.parts)
        sensors = self.description.sensors or self._name_sensors(boards)
        by_station: defaultdict[int, list[StationPart]] = defaultdict(list)
        for one in self.parts:
            by_station[one.station].append(one)
        for station in sorted(by_station):
            self._take(station, by_station[station], sensors)
        if not self.recordings:
            raise LogError(self._explain_nothing(), path=path)
        recordings, aligned = align_clocks(self.recordings)
        if aligned:
            self.notes.append(
                "the clocks of the boards have nothing in common: their recordings of a station "
                "were taken to begin at the same time"
            )
        order = [sensor.name for sensor in sensors if sensor.name in recordings]
        return Campaign(
            recordings={name: recordings[name] for name in order},
            description=replace(
                self.description,
                sensors=self.description.sensors or tuple(s for s in sensors if s.name in order),
                stations=self._list_stations(set(by_station)),
            ),
            inputs=tuple(self.inputs),
            findings=tuple(self._findings()),
            restarts=self.restarts,
        )

    def _list_stations(self, recorded: set[int]) -> tuple[Station, ...]:
        """Those of the description; recorded ones alone where others than the standard were."""
        if not self.description.assumed or recorded <= set(self.description.numbers):
            return self.description.stations
        return tuple(Station(number=number) for number in sorted(recorded))

    def _explain_nothing(self) -> str:
        return "; ".join(self.damaged[:3]) or (
            f"the station is not known (of {', '.join(self.unnumbered[:3])}): number the files, as "
            "in station-01.csv, or give them a column station"
            if self.unnumbered
            else "no sensor of the description is in the files"
        )

    def _name_sensors(self, boards: set[str]) -> tuple[Sensor, ...]:
        """A sensor for every one in the files, with a name of its own where boards share names."""
        found: dict[tuple[str, str], None] = {}
        count: defaultdict[str, set[str]] = defaultdict(set)
        for one in self.parts:
            board = one.board if one.board in boards else ""
            for name in one.part.sensors:
                found.setdefault((board, name))
                count[board].add(name)
        shared = [name for _, name in found]
        made: dict[str, Sensor] = {}
        for board, name in found:
            own = name
            if board and shared.count(name) > 1:
                own = board if len(count[board]) == 1 else f"{board} {name}"
                self.renamed[own] = f"{name} of {board}"
            made.setdefault(own, Sensor(name=own, column=name, board=board))
        return tuple(made.values())

    def _take(self, station: int, parts: list[StationPart], sensors: Sequence[Sensor]) -> None:
        """The sensors of a station that were asked for."""
        inside = [(one.board, one.part.sensors) for one in parts]
        chosen = {sensor.name: choose_readings(sensor, inside, sensors) for sensor in sensors}
        for sensor in sensors:
            found = chosen[sensor.name]
            if not found:
                self.absent[sensor.name].add(station)
                continue
            if len(found) > 1:
                self.twice[sensor.name].add(station)
            at, name = found[0]
            samples = parts[at].part.sensors[name]
            if sensor.temperature_of:
                lender = chosen.get(sensor.temperature_of) or []
                taken = [parts[k].part.sensors[n] for k, n in lender[:1]]
                samples = take_temperature_of(samples, taken[0] if taken else None)
            if parts[at].part.kelvin:
                self.kelvin[sensor.name].add(station)
            if restarts := parts[at].part.restarts.get(name):
                self.restarts.setdefault(sensor.name, {})[station] = restarts
            named = convert_unit(samples, sensor.unit).with_columns(name=sensor.name)
            self.recordings.setdefault(sensor.name, {})[station] = named

    def _findings(self) -> list[Finding]:
        """What was wrong with the files."""
        damaged = [
            Finding("damaged file", "check", text, "the rest is used; record it again if you can")
            for text in self.damaged
        ]
        found = []
        if self.kelvin:
            what = f"temperatures of {_name_by_station(self.kelvin)} are in kelvin although nothing"
            what += " says so: 273.15 was taken off"
            found.append(Finding("kelvin", "check", what, "name the column temperature_K"))
        if self.absent and self.description.sensors:
            what = f"there are no readings of {_name_by_station(self.absent)}"
            move = f"compare the names in {FILE_NAME} with the files (agonic info FILE)"
            found.append(Finding("absent sensor", "check", what, move))
        if self.twice:
            what = f"two files have readings of {_name_by_station(self.twice)}; the first was taken"
            move = f'say which with board = "…" of each [[sensor]] in {FILE_NAME}, or move one away'
            found.append(Finding("sensor twice", "check", what, move))
        if self.renamed:
            told = ", ".join(f"{new} ({old})" for new, old in self.renamed.items())
            what = f"boards have sensors of the same names, so they were named {told}"
            found.append(Finding("sensors renamed", "note", what))
        if self.unnumbered:
            what = f"{', '.join(self.unnumbered)}: which station it is cannot be told; left out"
            move = "number the files, or give them a column station"
            found.append(Finding("unknown station", "check", what, move))
        if self.surplus:
            what = f"{name_stations(self.surplus)} in the files is not described; left out"
            found.append(Finding("unknown station", "check", what, f"describe it in {FILE_NAME}"))
        return [*damaged, *found, *(Finding("reader's note", "note", note) for note in self.notes)]


def _find_boards(parts: Sequence[StationPart]) -> set[str]:
    """The boards that stand beside each other: at the same stations, with sensors of one name.

    A station that was recorded again, or a file that goes on where another ends, is no board.
    """
    stations: defaultdict[str, set[int]] = defaultdict(set)
    names: defaultdict[str, set[str]] = defaultdict(set)
    for part in parts:
        stations[part.board].add(part.station)
        names[part.board] |= set(part.part.sensors)
    most = max((len(own) for own in stations.values()), default=0)
    whole = [board for board, own in stations.items() if len(own) >= _SHARE * most]
    found: set[str] = set()
    for one, other in combinations(whole, 2):
        both = len(stations[one] & stations[other])
        beside = both >= _SHARE * min(len(stations[one]), len(stations[other])) and both
        if beside and names[one] & names[other]:
            found |= {one, other}
    return found


def _name_by_station(where: Mapping[str, set[int]]) -> str:
    """Sensors, and the stations where not all are alike."""
    groups: dict[tuple[int, ...], list[str]] = {}
    for name, numbers in where.items():
        groups.setdefault(tuple(sorted(numbers)), []).append(name)
    return "; ".join(
        f"{', '.join(names)} at {name_stations(numbers)}" for numbers, names in groups.items()
    )
