"""`agonic plan thermal`: a campaign in a climatic chamber before it starts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from agonic.console.options import Json
from agonic.console.parse import parse_numbers

if TYPE_CHECKING:
    from agonic.thermal.plan.plan import ThermalPlan


def plan_chamber(
    sensors: str,
    range_: str = "-10,50",
    rate: float = 10.0,
    noise: float | None = None,
    cooling: float = 0.5,
    heating: float = 1.0,
    hold: float = 15.0,
    step: float = 10.0,
    field: float = 48_000.0,
    dip: float = 65.0,
    degree: int = 3,
    fixture_sd: float = 1.0,
    field_sd: float = 0.0,
    room: float = 20.0,
    humidity: float = 50.0,
    repeat: int = 0,
    name: str = "",
    out: Path | None = None,
    folder: Path | None = None,
    as_json: Json = False,
) -> int:
    """Stations, chamber profile, time, disk space, and the standard errors to expect.

    Options
    -------
    sensors LIST : 2xMMC5883MA,3xMPU-9255; MODEL:NOISE states the noise, nT.
    range_ --range LOW,HIGH : Temperatures, °C.
    rate HZ : Readings a second.
    noise NT : Noise of a reading, for all sensors.
    cooling RATE : Cooling, °C/min.
    heating RATE : Heating, °C/min.
    hold MIN : The three holds.
    step DEG : Steps of heating, °C.
    field NT : Magnitude to expect.
    dip DEG : Inclination to expect.
    degree : Of the polynomials in temperature.
    fixture_sd DEG : How well the turns of the box are known.
    field_sd NT : Change of the field from station to station.
    room DEG : Temperature of the room, °C.
    humidity PERCENT : Relative humidity of the room's air.
    repeat N : Stations recorded again at the end; 3 show steps.
    name : Of the campaign.
    out -o FILE : Plan: .html or .txt.
    folder DIR : Folder for the recordings, with its campaign.toml.
    """
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
