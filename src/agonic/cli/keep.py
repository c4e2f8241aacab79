"""What `agonic calibrate --store` adds to a history: the rows that a fleet would have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from agonic.console.options import Place
from agonic.console.parse import parse_position
from agonic.field.decimal_year import parse_date
from agonic.fleet.inputs import name_sensors
from agonic.fleet.rows import make_row
from agonic.fleet.settings import FleetSettings, digest
from agonic.logs.log import Log
from agonic.population import History
from agonic.recording.calibrated import Calibrated
from agonic.version import __version__


def keep_results(
    store: Path,
    results: Sequence[Calibrated],
    log: Log,
    unit: str | None,
    place: Place,
    method: str,
    between: str | None,
    name: str | None,
) -> int:
    """Add what came of a log to a history; returns how many calibrations were new to it."""
    at, date, field = place
    asked = FleetSettings(
        unit=unit, at=parse_position(at) if at else None, date=date, field_nT=field, method=method
    )
    begun = None if date is None else parse_date(date)
    settings = asked.asked if between is None else f"{asked.asked} {between}"
    rows = []
    for result in results:
        row = make_row(
            result,
            sensor="",
            source=str(log.path),
            sha256=log.source.sha256,
            key=digest(log.source.sha256, result.samples.name, settings),
            settings=settings,
            version=__version__,
        )
        rows.append(replace(row, start=row.start or begun))
    if name is None:
        rows = name_sensors(str(log.path), rows, None)
    else:
        several = len(rows) > 1
        rows = [replace(r, sensor=f"{name} {r.channel}" if several else name) for r in rows]
    with History.open(store) as history:
        return history.add(rows)
