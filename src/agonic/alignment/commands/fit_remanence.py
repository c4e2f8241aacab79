"""`agonic fit remanence LOG`: whether a platform has a field of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.alignment.commands.options import Wanted
from agonic.console.options import Between, Json, LogPath, Report, Sensor, Unit
from agonic.console.sensors import open_sensor

_NEEDED = (
    "this needs the log of a magnetometer at rest beside a platform that is turned: its field, and "
    "the angle of the platform as heading_deg"
)


def add_to(kinds: typer.Typer) -> None:
    """Register the kind of fit."""
    kinds.command("remanence")(remanence)


def remanence(
    log: LogPath,
    reference: Annotated[
        Path | None,
        typer.Option(metavar="LOG", help="A magnetometer farther off; its changes are taken out."),
    ] = None,
    wanted: Wanted = 2.0,
    sensor: Sensor = None,
    unit: Unit = None,
    between: Between = None,
    report: Report = None,
    as_json: Json = False,
) -> int:
    """The field of a platform itself: it is turned, the magnetometer stands still.

    The angle of the platform is the column heading_deg. Exit status 1 where its field matters.
    """
    from agonic.alignment.remanence import fit_remanence
    from agonic.alignment.remanence.document import describe_remanence
    from agonic.console.finish import finish

    samples = open_sensor(log, sensor, unit, between, needed=_NEEDED)
    beside = None if reference is None else open_sensor(reference, None, unit, None)
    fit = fit_remanence(samples, beside, wanted_arcsec=wanted)
    return finish(describe_remanence(fit), report=report, as_json=as_json)
