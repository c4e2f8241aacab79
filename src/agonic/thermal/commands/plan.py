"""`agonic plan thermal`: a campaign in a climatic chamber before it starts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from agonic.console.options import Json
from agonic.console.parse import parse_numbers

if TYPE_CHECKING:
    from agonic.thermal.plan.plan import ThermalPlan


def plan_chamber(
    sensors: Annotated[
        str,
        typer.Option(
            metavar="LIST", help="2xMMC5883MA,3xMPU-9255; MODEL:NOISE states the noise, nT."
        ),
    ],
    range_: Annotated[
        str, typer.Option("--range", metavar="LOW,HIGH", help="Temperatures, °C.")
    ] = "-10,50",
    rate: Annotated[float, typer.Option(metavar="HZ", help="Readings a second.")] = 10.0,
    noise: Annotated[
        float | None, typer.Option(metavar="NT", help="Noise of a reading, for all sensors.")
    ] = None,
    cooling: Annotated[float, typer.Option(metavar="RATE", help="Cooling, °C/min.")] = 0.5,
    heating: Annotated[float, typer.Option(metavar="RATE", help="Heating, °C/min.")] = 1.0,
    hold: Annotated[float, typer.Option(metavar="MIN", help="The three holds.")] = 15.0,
    step: Annotated[float, typer.Option(metavar="DEG", help="Steps of heating, °C.")] = 10.0,
    field: Annotated[float, typer.Option(metavar="NT", help="Magnitude to expect.")] = 48_000.0,
    dip: Annotated[float, typer.Option(metavar="DEG", help="Inclination to expect.")] = 65.0,
    degree: Annotated[int, typer.Option(help="Of the polynomials in temperature.")] = 3,
    fixture_sd: Annotated[
        float, typer.Option(metavar="DEG", help="How well the turns of the box are known.")
    ] = 1.0,
    field_sd: Annotated[
        float, typer.Option(metavar="NT", help="Change of the field from station to station.")
    ] = 0.0,
    room: Annotated[float, typer.Option(metavar="DEG", help="Temperature of the room, °C.")] = 20.0,
    humidity: Annotated[
        float, typer.Option(metavar="PERCENT", help="Relative humidity of the room's air.")
    ] = 50.0,
    repeat: Annotated[
        int, typer.Option(metavar="N", help="Stations recorded again at the end; 3 show steps.")
    ] = 0,
    name: Annotated[str, typer.Option(help="Of the campaign.")] = "",
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="FILE", help="Plan: .html or .txt.")
    ] = None,
    folder: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder for the recordings, with its campaign.toml."),
    ] = None,
    as_json: Json = False,
) -> int:
    """Stations, chamber profile, time, disk space, and the standard errors to expect."""
    from agonic.console.finish import finish
    from agonic.thermal.campaign.profile import Profile
    from agonic.thermal.plan.document import describe_plan
    from agonic.thermal.plan.plan import plan_thermal

    lowest, highest = parse_numbers("--range", range_, "LOW,HIGH in °C")
    profile = Profile(
        lowest_C=lowest,
        highest_C=highest,
        hold_min=hold,
        cooling_C_per_min=cooling,
        heating_C_per_min=heating,
        step_C=step,
        room_C=room,
    )
    plan = plan_thermal(
        sensors,
        profile=profile,
        rate_Hz=rate,
        noise=noise,
        magnitude=field,
        inclination_deg=dip,
        degree=degree,
        fixture_sd_deg=fixture_sd,
        chamber_sd=field_sd,
        humidity_percent=humidity,
        repeat=repeat,
        name=name,
    )
    saved = [] if folder is None else [_write_template(plan, folder)]
    made, brief = describe_plan(plan), out is not None
    return finish(made, files=saved, report=out, option="-o", as_json=as_json, brief=brief)


def _write_template(plan: ThermalPlan, folder: Path) -> Path:
    """The folder for the recordings, with the description to go with them."""
    from agonic.atomic import make_folder
    from agonic.errors import AgonicError
    from agonic.thermal.files.schema import FILE_NAME
    from agonic.thermal.files.write import write_description

    if (folder / FILE_NAME).exists():
        raise AgonicError(f"{folder / FILE_NAME} is there already; name another folder")
    return write_description(plan.description, make_folder(folder) / FILE_NAME)
