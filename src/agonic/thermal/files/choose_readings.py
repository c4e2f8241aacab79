"""Which readings of a station are those of a described sensor, in the unit and time of the rest."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from agonic.logs.headers.columns import identify_column
from agonic.samples import Samples
from agonic.thermal.campaign.sensors import Sensor
from agonic.thermal.files.sensor_columns import find_label
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
    named = [k for k, (board, _) in enumerate(files) if _is_same(board, sensor.board)]
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


def _is_same(board: str, given: str) -> bool:
    return bool(given) and board.casefold() == given.casefold()


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
