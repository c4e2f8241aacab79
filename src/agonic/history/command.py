"""`agonic history [SENSOR]`: calibrations kept over time, and what they tell."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from agonic.console.options import Json

if TYPE_CHECKING:
    from datetime import datetime

    from agonic.population import History


def history(
    sensor: str | None = None,
    store: Annotated[
        Path | None,
        typer.Option(
            "--store",
            metavar="STORE",
            envvar="AGONIC_STORE",
            show_envvar=True,
            help="The history that agonic calibrate --store and agonic fleet --store write.",
        ),
    ] = None,
    date: str | None = None,
    out: Path | None = None,
    as_json: Json = False,
) -> int:
    """Show how calibrations drift, when a sensor stepped, and which no longer agree with others.

    Exit status 1 where the last calibration of a sensor lies outside the band that the earlier
    ones predict, or the sensor no longer agrees with its population.

    Options
    -------
    sensor <[SENSOR]> : Sensor to show; default: list all.
    date : Date to predict for, 2026-05-01; default: today.
    out -o HTML : Page to write of a sensor.
    """
    from agonic.errors import AgonicError
    from agonic.field.decimal_year import parse_date
    from agonic.population import History

    if store is None:
        raise AgonicError("name the history: --store STORE, or set AGONIC_STORE")
    if sensor is None and (out is not None or date is not None):
        raise AgonicError("-o and --date are of one sensor: agonic history SENSOR")
    with History.open(store, new=False) as kept:
        if sensor is None:
            return _show_all(kept, as_json)
        return _show_sensor(kept, sensor, None if date is None else parse_date(date), out, as_json)


def _show_all(kept: History, as_json: bool) -> int:
    from agonic.console.output import print_json, say
    from agonic.console.progress import counting
    from agonic.history.departure import departures, find_drifting
    from agonic.history.document import describe_history

    with counting(100) as tell:
        moving = find_drifting(kept, lambda done, of: tell("Drift", 100 * done // of))
    departed = departures(kept)
    found = describe_history(kept.sensors(), moving, departed)
    if as_json:
        print_json(found.schema, found.to_record())
    else:
        say(found.to_text())
    return 1 if departed else 0


def _show_sensor(
    kept: History, sensor: str, at: datetime | None, out: Path | None, as_json: bool
) -> int:
    from agonic.atomic import write_atomically
    from agonic.console.finish import finish
    from agonic.history.departure import add_departures, departures
    from agonic.history.document import describe_drift
    from agonic.history.fit import drift

    found = describe_drift(add_departures(drift(kept.of(sensor), at), departures(kept)))
    files = [] if out is None else [write_atomically(out, found.to_html())]
    return finish(found, files=files, as_json=as_json)
