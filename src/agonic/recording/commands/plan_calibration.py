"""`agonic plan calibration`: how finely to turn a vehicle, and what that will tell."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from agonic.console.options import Json


def add_to(kinds: typer.Typer) -> None:
    """Register the kind of plan."""
    kinds.command("calibration")(calibration)


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
        Path | None, typer.Option("-o", "--out", metavar="FILE", help="The positions, CSV.")
    ] = None,
    as_json: Json = False,
) -> int:
    """Three sets of readings about three axes: the errors to expect for each step of rotation."""
    from agonic.console.finish import finish
    from agonic.ellipsoid.plan import plan_calibration
    from agonic.recording.plan_document import choose_sets, describe_plan

    sets = plan_calibration(
        magnitude=field,
        inclination_deg=dip,
        noise=noise,
        tilt_deg=tilt,
        attitude_sd_deg=attitude_sd,
        wanted_deg=wanted,
    )
    chosen = choose_sets(sets, wanted)
    files = [] if out is None or chosen is None else [_write_positions(chosen.attitudes_deg, out)]
    finish(describe_plan(sets, wanted_deg=wanted), files=files, as_json=as_json)
    return 0 if chosen is not None else 1


def _write_positions(attitudes_deg: object, out: Path) -> Path:
    """The positions in their order, a row each."""
    import numpy as np

    from agonic.atomic import write_atomically

    rows = np.asarray(attitudes_deg).tolist()
    lines = [f"{k},{r:g},{p:g},{h:g}" for k, (r, p, h) in enumerate(rows, start=1)]
    return write_atomically(
        out, "\n".join(["position,roll_deg,pitch_deg,heading_deg", *lines]) + "\n"
    )
