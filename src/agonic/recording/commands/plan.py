"""`agonic plan calibration|disturbers|placement`: what to record, and what that will tell."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.console.options import Between, Json, Report, SensorChoice, Unit


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
    from agonic.recording.plan_documents import describe_placement, describe_places

    if b"place" in read_bytes(source).split(b"\n", 1)[0]:
        ranked = rank_places(read_places(source), noise)
        finish(describe_places(ranked, horizontal), report=report, as_json=as_json)
        return 0
    sensors = open_sensors(source, None, unit, between)[1]
    if len(sensors) < 2:
        raise AgonicError(f"{source} holds one magnetometer; record two, or give a table of places")
    if any(one.unit != "nT" for one in sensors[:2]):
        raise UnitError("name the unit of the readings with --unit: the disturbance is given in nT")
    names = [one.name for one in sensors]
    if first is not None and first not in names:
        raise AgonicError(f"{source} holds {', '.join(names)}, and not {first}")
    own = sensors[0 if first is None else names.index(first)]
    other = next(one for one in sensors if one is not own)
    mix = judge_recording(own.with_second(other))
    finish(describe_placement(mix, horizontal), report=report, as_json=as_json)
    return 0


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
    from agonic.attitude.disturbers.plan import judge_disturbers
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
