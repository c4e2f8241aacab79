"""Tables of places and dates for the world model, and the tables of its answers."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np

from agonic.arrays import Array, Index
from agonic.atomic import write_atomically
from agonic.errors import AgonicError, LogError
from agonic.field.decimal_year import decimal_year
from agonic.field.worldfield import ELEMENTS
from agonic.logs.contents import read_text
from agonic.logs.headers.header import Column, identify_column

_RANGES = {
    "latitude_deg": (-90.0, 90.0),
    "longitude_deg": (-180.0, 360.0),
    "altitude_m": (-1e4, 1e9),
}
_WHEN = ("date", "time")
_YEARS = (1000.0, 3000.0)  # a number out here is no decimal year


@dataclass(frozen=True, kw_only=True, eq=False)
class Points:
    """Places and dates: (n,) degrees, metres above WGS-84, dates as given and as decimal years.

    `rows` (n,) are their line numbers in the file.
    """

    path: Path
    rows: Index
    latitude_deg: Array
    longitude_deg: Array
    altitude_m: Array
    dates: tuple[str, ...]
    years: Array

    def __len__(self) -> int:
        return len(self.rows)


def read_points(path: Path | str, date: str | None = None) -> Points:
    """The places of a CSV file with a header.

    Columns are latitude_deg and longitude_deg, and may be altitude_m (else 0) and date or time
    (ISO 8601 or a decimal year; else `date` for all), or other names that a log may have for them.
    Raises `LogError` with the row for a cell that is no place or date, or without such columns.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     csv = Path(folder) / "points.csv"
    ...     _ = csv.write_text("lat,lon,date\\n52,5,2026-03-01\\n-33.5,151.2,2026.5\\n")
    ...     points = read_points(csv)
    ...     points.latitude_deg.tolist(), points.dates
    ([52.0, -33.5], ('2026-03-01', '2026.5'))
    """
    path = Path(path)
    lines = csv.reader(StringIO(read_text(path, "a CSV file of points")))
    table = [(lines.line_num, cells) for cells in lines if "".join(cells).strip()]
    if len(table) < 2:
        raise LogError("there is no row of a place below a header", path=path)
    header, body = table[0][1], table[1:]
    places = _columns(header, path, date)
    cells: dict[str, list[str]] = {name: [] for name in places}
    for row, line in body:
        for name, (position, _) in places.items():
            if position >= len(line):
                raise LogError(f"there is no {header[position]}", path=path, row=row)
            cells[name].append(line[position].strip())
    rows = np.array([row for row, _ in body])
    numbers = {
        name: _numbers(cells[name], rows, path, name, places[name][1])
        for name in _RANGES
        if name in places
    }
    when = next((name for name in _WHEN if name in places), None)
    dates = tuple(cells[when]) if when else (str(date),) * len(rows)
    return Points(
        path=path,
        rows=rows,
        latitude_deg=numbers["latitude_deg"],
        longitude_deg=numbers["longitude_deg"],
        altitude_m=numbers.get("altitude_m", np.zeros(len(rows))),
        dates=dates,
        years=_years(dates, rows, path),
    )


def write_points(
    points: Points, models: Sequence[str], answers: Mapping[str, Array], path: Path | str
) -> Path:
    """Write `format_points` to a file, and return its path."""
    return write_atomically(path, format_points(points, models, answers))


def format_points(points: Points, models: Sequence[str], answers: Mapping[str, Array]) -> str:
    """A row a place: where and when, the model, and the answers by name, nT to 0.1 pT."""
    stream = StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(
        ["latitude_deg", "longitude_deg", "altitude_m", "date", "model", *map(read_header, answers)]
    )
    columns = [
        [f"{value:.6f}" if "_deg" in name else f"{value:.4f}" for value in values]
        for name, values in answers.items()
    ]
    places = (points.latitude_deg, points.longitude_deg, points.altitude_m)
    where = [[f"{value:.12g}" for value in values] for values in places]
    writer.writerows(zip(*where, points.dates, models, *columns, strict=True))
    return stream.getvalue()


def read_header(name: str) -> str:
    """The name of an answer with its unit.

    >>> read_header("north"), read_header("north_per_year"), read_header("declination_deg_per_year")
    ('north_nT', 'north_nT_per_year', 'declination_deg_per_year')
    """
    element = name.removesuffix("_per_year")
    plain = element in ELEMENTS and not element.endswith("_deg")
    return f"{element}_nT{name[len(element) :]}" if plain else name


def _columns(header: Sequence[str], path: Path, date: str | None) -> dict[str, tuple[int, Column]]:
    """Position and meaning of the columns that tell where and when."""
    found: dict[str, tuple[int, Column]] = {}
    for position, name in enumerate(header):
        column = identify_column(name)
        wanted = column is not None and column.quantity.column in (*_RANGES, *_WHEN)
        if column is None or not wanted:
            continue
        if column.quantity.column == "time" and column.unit:  # seconds of a log are no date
            continue
        twin = found.setdefault(column.quantity.column, (position, column))
        if twin[0] != position:
            raise LogError(
                f"{header[twin[0]]!r} and {name!r} could both be the {column.quantity.name}; "
                "rename or remove one of them",
                path=path,
            )
    missing = [name for name in ("latitude_deg", "longitude_deg") if name not in found]
    if missing:
        raise LogError(
            f"no column {' or '.join(missing)} among {', '.join(map(repr, header[:10]))}; "
            "the first line must name the columns",
            path=path,
        )
    if date is None and not set(_WHEN) & set(found):
        raise LogError("there is no column date; add one, or give --date for all", path=path)
    return found


def _numbers(cells: Sequence[str], rows: Index, path: Path, name: str, column: Column) -> Array:
    """A column of numbers in our unit, each within its range."""
    factor, offset = column.quantity.units.get(column.unit or "", (1.0, 0.0))
    low, high = _RANGES[name]
    values = np.empty(len(cells))
    for i, cell in enumerate(cells):
        try:
            values[i] = float(cell) * factor + offset
        except ValueError:
            values[i] = np.nan
        if not low <= values[i] <= high:
            raise LogError(
                f"{column.header} is {cell!r}; it needs a number from {low:g} to {high:g} ({name})",
                path=path,
                row=int(rows[i]),
            )
    return values


def _years(dates: Sequence[str], rows: Index, path: Path) -> Array:
    """The decimal years of dates, each different one worked out once."""
    known: dict[str, float] = {}
    for date, row in zip(dates, rows.tolist(), strict=True):
        if date not in known:
            try:
                known[date] = _year(date)
            except AgonicError as error:
                raise LogError(str(error), path=path, row=row) from None
    return np.array([known[date] for date in dates])


def _year(date: str) -> float:
    """The decimal year of an ISO 8601 date, or of a decimal year in figures."""
    try:
        year = float(date)
    except ValueError:
        return float(decimal_year(date))
    if not _YEARS[0] <= year <= _YEARS[1]:
        raise AgonicError(f"{date} is not a year; give a date like 2026-03-01, or like 2026.17")
    return year
