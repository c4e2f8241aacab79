"""`agonic plan thermal`: a campaign in a climatic chamber before it starts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from agonic.console.options import Json

if TYPE_CHECKING:
    from agonic.thermal.plan.plan import ThermalPlan


def add_to(kinds: typer.Typer) -> None:
    """Register the kind of plan."""
    kinds.command("thermal")(plan_chamber)


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
    from agonic.console.output import print_json, say
    from agonic.thermal.campaign.profile import Profile
    from agonic.thermal.plan.plan import plan_thermal
    from agonic.thermal.plan.text import plan_text

    lowest, highest = _parse_range(range_)
    profile = Profile(
        lowest_C=lowest,
        highest_C=highest,
        hold_min=hold,
        cooling_C_per_min=cooling,
        heating_C_per_min=heating,
        step_C=step,
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
        name=name,
    )
    files = [*_write_plan(plan, out), *_write_template(plan, folder)]
    if as_json:
        print_json("agonic/plan-thermal@1", {**record(plan), "files": files})
    else:
        say(plan_text(plan))
        if files:
            say(f"\nWritten   {', '.join(files)}")
    return 0


def _parse_range(text: str) -> tuple[float, float]:
    from agonic.errors import AgonicError

    try:
        low, high = (float(part.replace("−", "-")) for part in text.split(","))
    except ValueError:
        raise AgonicError(f"--range {text!r} is no range; write LOW,HIGH in °C: -10,50") from None
    return low, high


def _write_plan(plan: ThermalPlan, out: Path | None) -> list[str]:
    """The plan in the form that its name asks for."""
    from agonic.console.printed_page import written_as_named
    from agonic.thermal.plan.page import plan_page
    from agonic.thermal.plan.text import plan_text

    return written_as_named(out, "-o", page=lambda: plan_page(plan), text=lambda: plan_text(plan))


def _write_template(plan: ThermalPlan, folder: Path | None) -> list[str]:
    """The folder for the recordings, with the description to go with them."""
    from agonic.atomic import make_folder
    from agonic.errors import AgonicError
    from agonic.thermal.files.schema import FILE_NAME
    from agonic.thermal.files.write import write_description

    if folder is None:
        return []
    if (folder / FILE_NAME).exists():
        raise AgonicError(f"{folder / FILE_NAME} is there already; name another folder")
    return [str(write_description(plan.description, make_folder(folder) / FILE_NAME))]


def record(plan: ThermalPlan) -> dict[str, Any]:
    """The plan as one object for programs."""
    from dataclasses import asdict

    from agonic.maths.rotations.attitude import angles_deg

    stations = []
    for station, turn in zip(plan.stations, plan.turns, strict=True):
        assert station.rot_nb is not None
        roll, pitch, heading = (float(a) + 0.0 for a in angles_deg(station.rot_nb.as_matrix()))
        stations.append(
            {
                "number": station.number,
                "pose": station.pose,
                "turn": turn,
                "roll_deg": roll,
                "pitch_deg": pitch,
                "heading_deg": heading,
                "matrix_nb": station.rot_nb.as_matrix(),
            }
        )
    segments = [*plan.profile.before, *plan.profile.recording]
    return {
        "sensors": [
            {"name": s.name, "model": s.model, "noise_nT": s.reading_sd} for s in plan.sensors
        ],
        "stations": stations,
        "profile": [asdict(segment) for segment in segments],
        "rate_Hz": plan.rate_Hz,
        "station_s": plan.profile.recorded_s,
        "duration_s": plan.duration_s,
        "rows": plan.rows,
        "bytes_csv": plan.bytes_csv,
        "bytes_parquet": plan.bytes_parquet,
        "expected_nT": {
            name: {
                kind: {"bias_rms": found.bias, "matrix_rms": found.matrix}
                for kind, found in by.items()
            }
            for name, by in plan.expected.items()
        },
    }
