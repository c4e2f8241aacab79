"""`agonic field`: the world model at a place, or at the points of a table."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from agonic.console.options import Json
from agonic.errors import AgonicError, LogError, ValidityError

if TYPE_CHECKING:
    from agonic.arrays import Array, Index
    from agonic.field.world_model import Model
    from agonic.field.worldfield import WorldField
    from agonic.logs.space.positions import Points


def field(
    at: str | None = None,
    points: Path | None = None,
    date: str | None = None,
    model: str | None = None,
    out: Path | None = None,
    as_json: Json = False,
) -> int:
    """Print the elements of the geomagnetic field and their change in a year.

    Options
    -------
    at LAT,LON[,ALT] : Degrees, and metres above WGS-84.
    points CSV : Table of latitude_deg, longitude_deg, altitude_m, date.
    date : Date, 2026-05-01; default: today.
    model : igrf, wmm or wmmhr; default: wmm where valid, else igrf.
    out -o CSV : Table to write, of points.
    """
    if (at is None) == (points is None):
        raise AgonicError(
            "give a place (--at LAT,LON[,ALT]) or a table of places (--points CSV)"
            + ", not both" * (at is not None)
        )
    if at is not None:
        if out is not None:
            raise AgonicError("-o writes the table of --points; a place is printed")
        return _place(at, date, model, as_json)
    assert points is not None, "one of the two is given"
    return _table(points, date, model, out, as_json)


def _place(at: str, date: str | None, model: str | None, as_json: bool) -> int:
    """The elements at one place."""
    from datetime import UTC, datetime

    from agonic.console.output import print_json, say
    from agonic.console.parse import parse_position
    from agonic.field.decimal_year import decimal_year
    from agonic.field.place import choose_model

    when = date or datetime.now(UTC).date().isoformat()
    latitude, longitude, altitude = parse_position(at)
    chosen = choose_model(float(decimal_year(when)), model)
    here = chosen.at(latitude, longitude, altitude, when)
    elements, change = here.elements(), here.elements_per_year()
    if as_json:
        print_json(
            "agonic/field@1",
            {
                "model": here.model,
                "latitude_deg": latitude,
                "longitude_deg": longitude,
                "altitude_m": altitude,
                "date": when,
                "elements": elements,
                "per_year": change,
                "declination_sd_deg": here.declination_sd_deg,
            },
        )
        return 0
    say(f"{here.model} at {latitude:g}°, {longitude:g}°, {altitude:g} m on {when}")
    for name, value in elements.items():
        unit = "°" if name.endswith("deg") else "nT"
        label = name.removesuffix("_deg")
        say(f"  {label:<12}{float(value):12.3f} {unit:<3}{float(change[name]):+10.3f} {unit}/year")
    say(f"  declination is good to {float(here.declination_sd_deg):.2f}° (one standard deviation)")
    return 0


def _table(path: Path, date: str | None, model: str | None, out: Path | None, as_json: bool) -> int:
    """The elements at every point of a table, each by the model that holds then."""
    from agonic.console.output import print_json, say
    from agonic.logs.space.positions import format_points, read_header, read_points, write_points

    points = read_points(path, date)
    models, answers = _answers(points, model)
    files = [str(write_points(points, models, answers, out))] if out else []
    if as_json:
        columns = {read_header(name): values for name, values in answers.items()}
        print_json(
            "agonic/field-points@1",
            {
                "n": len(points),
                "files": files,
                "latitude_deg": points.latitude_deg,
                "longitude_deg": points.longitude_deg,
                "altitude_m": points.altitude_m,
                "date": points.dates,
                "model": models,
                **columns,
            },
        )
    elif out:
        say(f"{len(points)} points: {out}")
    else:
        print(format_points(points, models, answers), end="")
    return 0


def _answers(points: Points, model: str | None) -> tuple[list[str], dict[str, Array]]:
    """The name of the model of each point, and elements, yearly changes and errors (n,) by name."""
    import numpy as np

    from agonic.field.place import choose_model

    years, of_row = np.unique(points.years, return_inverse=True)
    names = np.array([choose_model(year, model).name for year in years])[of_row]
    answers: dict[str, Array] = {}
    for name in np.unique(names):
        rows = np.flatnonzero(names == name)
        there = _at_rows(choose_model(points.years[rows[0]], model), points, rows)
        change = {f"{key}_per_year": value for key, value in there.elements_per_year().items()}
        every = {**there.elements(), **change, "declination_sd_deg": there.declination_sd_deg}
        for key, values in every.items():
            answers.setdefault(key, np.empty(len(points)))[rows] = values
    return names.tolist(), answers


def _at_rows(model: Model, points: Points, rows: Index) -> WorldField:
    """The field at some of the points; an error names the first row that the model refuses."""
    try:
        return model.at(
            points.latitude_deg[rows],
            points.longitude_deg[rows],
            points.altitude_m[rows],
            points.years[rows],
        )
    except ValidityError as error:
        first = rows if error.mask is None else rows[error.mask]
        raise LogError(str(error), path=points.path, row=int(points.rows[first[0]])) from None
