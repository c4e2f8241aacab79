"""`agonic plan disturbers [LOG]`: what to switch while recording, and what a recording lacks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.console.options import Between, Json, Sensor, Unit


def add_to(kinds: typer.Typer) -> None:
    """Register the kind of plan."""
    kinds.command("disturbers")(disturbers)


def disturbers(
    log: Annotated[
        Path | None, typer.Argument(metavar="[LOG]", help="A recording to judge.")
    ] = None,
    motors: Annotated[int, typer.Option(min=0, max=12, help="Of the vehicle.")] = 4,
    also: Annotated[
        str, typer.Option("--with", metavar="NAMES", help="What else is switched on board.")
    ] = "",
    noise: Annotated[float, typer.Option(metavar="NT", help="Of one reading on an axis.")] = 300.0,
    sensor: Sensor = None,
    unit: Unit = None,
    between: Between = None,
    as_json: Json = False,
) -> int:
    """What to switch while recording; of a LOG, what it tells of each disturber and what to add."""
    from agonic.console.finish import finish
    from agonic.console.parse import parse_names
    from agonic.recording.plans.disturbers import describe_judged, describe_steps

    if log is None:
        finish(describe_steps(motors, parse_names(also)), as_json=as_json)
        return 0
    from agonic.attitude.disturbers.plan import judge_disturbers
    from agonic.console.sensors import open_sensors

    samples = open_sensors(log, sensor, unit, between)[1][0]  # the same stands beside each sensor
    judged = judge_disturbers(samples, noise=noise)
    finish(describe_judged(samples.name, judged), as_json=as_json)
    return 0
