"""`agonic field --at … --date …`: the world model at a place."""

from __future__ import annotations

from typing import Annotated

import typer

from agonic.cli.options import Date, Json
from agonic.errors import AgonicError


def add_to(app: typer.Typer) -> None:
    """Register the command."""
    app.command("field")(field)


def field(
    at: Annotated[
        str, typer.Option("--at", metavar="LAT,LON[,ALT]", help="Degrees, and metres above WGS-84.")
    ],
    date: Date = None,
    model: Annotated[
        str | None, typer.Option(help="igrf, wmm or wmmhr; default: wmm where valid, else igrf.")
    ] = None,
    as_json: Json = False,
) -> int:
    """Print the elements of the geomagnetic field and their change in a year."""
    from datetime import UTC, datetime

    from agonic import field as models
    from agonic.cli.output import print_json, say
    from agonic.cli.place import position
    from agonic.field.decimal_year import decimal_year
    from agonic.field.place import model_for

    when = date or datetime.now(UTC).date().isoformat()
    known = {"igrf": models.igrf, "wmm": models.wmm, "wmmhr": models.wmmhr}
    if model is not None and model not in known:
        raise AgonicError(f"--model {model!r} is not known; use one of {', '.join(known)}")
    chosen = known[model]() if model else model_for(float(decimal_year(when)))
    latitude, longitude, altitude = position(at)
    here = chosen.at(latitude, longitude, altitude, when)
    elements, change = here.elements(), here.elements_per_year()
    if as_json:
        print_json("agonic/field@1", {
            "model": here.model, "latitude_deg": latitude, "longitude_deg": longitude,
            "altitude_m": altitude, "date": when, "elements": elements, "per_year": change,
            "declination_sd_deg": here.declination_sd_deg,
        })  # fmt: skip
        return 0
    say(f"{here.model} at {latitude:g}°, {longitude:g}°, {altitude:g} m on {when}")
    for name, value in elements.items():
        unit = "°" if name.endswith("deg") else "nT"
        label = name.removesuffix("_deg")
        say(f"  {label:<12}{float(value):12.3f} {unit:<3}{float(change[name]):+10.3f} {unit}/year")
    say(f"  declination is good to {float(here.declination_sd_deg):.2f}° (one standard deviation)")
    return 0
