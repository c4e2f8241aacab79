"""`agonic plan placement LOG|TABLE`: where a second magnetometer should sit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.console.options import Between, Json, Report, Unit


def add_to(kinds: typer.Typer) -> None:
    """Register the kind of plan."""
    kinds.command("placement")(placement)


def placement(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="LOG|TABLE",
            help="A recording of two magnetometers, strapped down; or a table of places.",
        ),
    ],
    horizontal: Annotated[
        float, typer.Option(metavar="NT", help="Level part of the field.", min=1.0)
    ] = 20_000.0,
    noise: Annotated[
        float, typer.Option(metavar="NT", help="Of a reading on an axis, for a table.", min=0.001)
    ] = 200.0,
    first: Annotated[
        str | None, typer.Option(metavar="SENSOR", help="Which of the recording is the first.")
    ] = None,
    unit: Unit = None,
    between: Between = None,
    report: Report = None,
    as_json: Json = False,
) -> int:
    """The mix of two magnetometers that cancels best, its cost in noise, and a better placement.

    A table has a row for each place and source: place,source,add_x_nT,add_y_nT,add_z_nT, what is
    added to the field there when the source is switched on.
    """
    from agonic.attitude.disturbers.placement import judge_recording, rank_places, read_places
    from agonic.console.finish import finish
    from agonic.console.sensors import open_sensors
    from agonic.errors import AgonicError, UnitError
    from agonic.logs.contents import read_bytes
    from agonic.recording.plans.placement import describe_placement, describe_places

    if b"place" in read_bytes(source).split(b"\n", 1)[0]:
        ranked = rank_places(read_places(source), noise)
        finish(describe_places(ranked, horizontal), report=report, as_json=as_json)
        return 0
    sensors = open_sensors(source, None, unit, between)[1]
    if len(sensors) < 2:
        raise AgonicError(f"{source} holds one magnetometer; record two, or give a table of places")
    if any(one.unit != "nT" for one in sensors[:2]):
        raise UnitError("name the unit of the readings with --unit: what disturbs is told in nT")
    names = [one.name for one in sensors]
    if first is not None and first not in names:
        raise AgonicError(f"{source} holds {', '.join(names)}, and not {first}")
    own = sensors[0 if first is None else names.index(first)]
    other = next(one for one in sensors if one is not own)
    mix = judge_recording(own.with_second(other))
    finish(describe_placement(mix, horizontal), report=report, as_json=as_json)
    return 0
