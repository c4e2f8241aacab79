"""A recording that is longer than memory: one Parquet table, read piece by piece."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from agonic.logs.large.mission import Mission
    from agonic.logs.log import Log
    from agonic.recording.calibrated import Calibrated


def open_missions(
    log: Path, sensor: str | None, unit: str | None, all_rows: Mapping[str, str | bool | None]
) -> tuple[Mission, ...]:
    """One for each magnetometer of a table too long for memory; none where it is not.

    Nor where a column names the sensor row by row. `all_rows` are options that need all rows at
    once, with what was given, if anything.
    """
    from dataclasses import replace

    from agonic.errors import AgonicError
    from agonic.logs.large.mission import is_long, open_mission

    if not is_long([log]):
        return ()
    mission = open_mission([log], sensor=sensor, unit=unit)
    names = mission.sensors()
    given = [name for name, value in all_rows.items() if value]
    if names and given:
        raise AgonicError(
            f"{log.name} has {mission.rows} rows and is read piece by piece, by the magnitude "
            f"alone, without {', '.join(given)}; cut it, or leave that away"
        )
    if sensor is not None:
        return (mission,) if names else ()
    return tuple(replace(mission, sensor=name) for name in names)


def calibrate_mission(
    mission: Mission, at: str | None, date: str | None, field: float | None, **settings: Any
) -> Calibrated:
    """The calibration of a mission, with the field of the place."""
    from agonic.console.place import find_reference
    from agonic.console.progress import counting
    from agonic.recording.calibrated import calibrate_recording

    reference, of_place = find_reference(mission.head(), at, date, field)
    with counting(mission.rows) as tell:
        return calibrate_recording(mission, reference, progress=tell, **settings, **of_place)


def make_log(mission: Mission, results: list[Calibrated]) -> Log:
    """The rows that were kept of a mission, as the log that they came from."""
    from agonic.logs.log import Log
    from agonic.logs.remote import name_locally

    return Log(
        path=name_locally(mission.files[0]),
        format="Parquet table",
        source=mission.inputs[0],
        sensors=tuple(result.samples for result in results),
    )
