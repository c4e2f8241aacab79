"""`agonic plan calibration|disturbers`: what to record, and what that will tell."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.console.options import Between, Json, SensorChoice


def disturbers(
    log: Annotated[
        Path | None, typer.Argument(metavar="[LOG]", help="A recording to judge.")
    ] = None,
    motors: Annotated[int, typer.Option(min=0, max=12, help="Of the vehicle.")] = 4,
    also: Annotated[
        str, typer.Option("--with", metavar="NAMES", help="What else is switched on board.")
    ] = "",
    noise: Annotated[float, typer.Option(metavar="NT", help="Of one reading on an axis.")] = 300.0,
    which: SensorChoice = SensorChoice(),
    between: Between = None,
    as_json: Json = False,
) -> int:
    """What to switch while recording; for a LOG, how well each is known and what to add."""
    from agonic.console.finish import finish
    from agonic.console.parse import parse_names
    from agonic.recording.plan_documents import describe_judged, describe_steps

    if log is None:
        finish(describe_steps(motors, parse_names(also)), as_json=as_json)
        return 0
    from agonic.attitude.disturbers.choice import judge_disturbers
    from agonic.console.sensors import open_sensors

    samples = open_sensors(log, *which, between)[1][0]  # the same stands beside each sensor
    judged = judge_disturbers(samples, noise=noise)
    finish(describe_judged(samples.name, judged), as_json=as_json)
    return 0


def calibration(
    wanted: Annotated[
        float | None, typer.Option(metavar="DEG", help="Standard error of the heading wanted.")
    ] = None,
    tilt: Annotated[
        float, typer.Option(metavar="DEG", help="How far it can be tilted; from 90 turned over.")
    ] = 180.0,
    attitude_sd: Annotated[
        float | None,
        typer.Option("--attitude-sd", metavar="DEG", help="Roll and pitch are logged this well."),
    ] = None,
    noise: Annotated[float, typer.Option(metavar="NT", help="Of one reading on an axis.")] = 300.0,
    field: Annotated[float, typer.Option(metavar="NT", help="Magnitude to expect.")] = 48_000.0,
    dip: Annotated[float, typer.Option(metavar="DEG", help="Inclination to expect.")] = 65.0,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="FILE", help="The positions, .csv; a page, .html."),
    ] = None,
    as_json: Json = False,
) -> int:
    """Three sets of readings about three axes: the errors to expect for each step of rotation."""
    from agonic.console.finish import finish
    from agonic.ellipsoid.plan import plan_calibration
    from agonic.recording.plan_documents import choose_sets, describe_plan

    sets = plan_calibration(
        magnitude=field,
        inclination_deg=dip,
        noise=noise,
        tilt_deg=tilt,
        attitude_sd_deg=attitude_sd,
        wanted_deg=wanted,
    )
    chosen = choose_sets(sets, wanted)
    made = describe_plan(sets, wanted_deg=wanted)
    if chosen is None:
        finish(made, as_json=as_json)
        return 1
    forms = {".csv": lambda: _list_positions(chosen.attitudes_deg)}
    return finish(made, report=out, option="-o", forms=forms, as_json=as_json)


def _list_positions(attitudes_deg: object) -> str:
    """The positions in their order, a row each, as text."""
    import numpy as np

    rows = np.asarray(attitudes_deg).tolist()
    lines = [f"{k},{r:g},{p:g},{h:g}" for k, (r, p, h) in enumerate(rows, start=1)]
    return "\n".join(["position,roll_deg,pitch_deg,heading_deg", *lines]) + "\n"
