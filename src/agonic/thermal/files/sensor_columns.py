"""What the columns of a campaign's files are, as its description names them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from agonic.logs.headers.column_names import ColumnNames
from agonic.thermal.campaign.description import Description
from agonic.thermal.campaign.sensors import Sensor
from agonic.thermal.files.schema import FILE_NAME

_FIRST = 901
"""The number of the first sensor whose axes are named: above what loggers count to."""
_NAME = re.compile(r"([a-z]+)(.*)", re.IGNORECASE)


def name_columns(description: Description, board: str = "") -> ColumnNames | None:
    """The names of the columns in the files of a board, or `None` where none are given.

    Every sensor whose columns are named gets a number, so that several in a file are told apart; a
    column that several share is nobody's.

    >>> one = Sensor(name="MMC", columns={"x": "A1", "y": "A2", "z": "A3", "temperature": "T1"})
    >>> name_columns(Description(sensors=(one,), columns={"time": "t"})).headers
    {'time': 't', 'mag901_x': 'A1', 'mag901_y': 'A2', 'mag901_z': 'A3', 'temperature901': 'T1'}
    """
    named = dict(description.columns)
    for number, sensor in enumerate(description.sensors, start=_FIRST):
        if board and sensor.board and sensor.board.casefold() != board.casefold():
            continue
        named |= _name_own(sensor, f"{number}", named)
    if not named:
        return None
    return ColumnNames(headers=named, where=FILE_NAME, several=True)


def find_label(sensor: Sensor, sensors: Sequence[Sensor]) -> str:
    """What the readings of a sensor are called in the files after their columns were named."""
    named = sensor.columns.get("x") and sensor in sensors
    return f"mag{_FIRST + list(sensors).index(sensor)}" if named else sensor.column


def _name_own(sensor: Sensor, number: str, before: Mapping[str, str]) -> dict[str, str]:
    """The names of a sensor's columns; one that has been named before is shared."""
    label = number if "x" in sensor.columns else _strip_name(sensor.column or sensor.name)
    made = {}
    for name, header in sensor.columns.items():
        if name in "xyz":
            made[f"mag{label}_{name}"] = header
        elif header in before.values():
            made[name] = header
        elif label.isdecimal() or not label:
            made[_NAME.sub(rf"\g<1>{label}\g<2>", name, count=1)] = header
        else:
            made[f"{label}_{name}"] = header
    return made


def _strip_name(name: str) -> str:
    """The number of a sensor that is called by one: 2 of mag2."""
    return name.removeprefix("mag") if name.removeprefix("mag").isdecimal() else name
