"""Tables of places and dates for the world model, and the tables of its answers."""

from __future__ import annotations

import csv
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from io import StringIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Index
from agonic.atomic import write_atomically
from agonic.errors import AgonicError, AgonicWarning, LogError, MissingExtraError
from agonic.field.decimal_year import decimal_year
from agonic.field.worldfield import ELEMENTS
from agonic.logs.contents import read_bytes, read_text, to_number
from agonic.logs.headers.header import Column, identify_column
from agonic.maths.earth.earth_rotation import rotate_about_third, sidereal_rad
from agonic.maths.earth.geodesy import geodetic
from agonic.units import DAY_S

_RANGES = {
    "latitude_deg": (-90.0, 90.0),
    "longitude_deg": (-180.0, 360.0),
    "altitude_m": (-1e4, 1e9),
}
_WHEN = ("date", "time")


@dataclass(frozen=True, kw_only=True, eq=False)
class Points:
    """Places and dates: (n,) degrees, metres above WGS-84, dates as given and as decimal years.
    `rows` (n,) are their line numbers in the file."""

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
    """The places of a CSV file with a header: latitude_deg and longitude_deg, perhaps altitude_m
    (else 0) and date or time (ISO 8601 or a decimal year; else `date` for all), or other names that
    a log may have for them. Raises `LogError` with the row for a cell that is no place or date."""
    path = Path(path)
    lines = csv.reader(StringIO(read_text(path, "a CSV file of points")))
    table = [(lines.line_num, cells) for cells in lines if "".join(cells).strip()]
    if len(table) < 2:
        raise LogError("there is no row of a place below a header", path=path)
    header, body = table[0][1], table[1:]
    places = _columns(header, path, date)
    for row, line in body:
        short = next((at for at, _ in places.values() if at >= len(line)), None)
        if short is not None:
            raise LogError(f"there is no {header[short]}", path=path, row=row)
    rows = np.array([row for row, _ in body])
    cells = {name: [line[at].strip() for _, line in body] for name, (at, _) in places.items()}
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
    """The name of an answer with its unit."""
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
        values[i] = to_number(cell) * factor + offset
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
        if date in known:
            continue
        known[date] = to_number(date)
        try:
            known[date] = float(decimal_year(date)) if math.isnan(known[date]) else known[date]
        except AgonicError as error:
            raise LogError(str(error), path=path, row=row) from None
        if not 1000 <= known[date] <= 3000:
            why = f"{date} is not a year; give a date like 2026-03-01, or like 2026.17"
            raise LogError(why, path=path, row=row)
    return np.array([known[date] for date in dates])


_UNIX_JULIAN_DATE = 2_440_587.5


def positions_from_tle(
    tle: Path | str, time: ArrayLike, epoch: datetime, *, satellite: int | None = None
) -> dict[str, Array]:
    """Where a satellite was, by SGP4 from its two-line elements.

    Of several sets of elements of one satellite each row takes the one that is nearest in time.
    Positions are good to a kilometre or so near the time of the elements, and lose about one
    more each day in a low orbit.

    Parameters
    ----------
    tle : the lines themselves, with or without names between them, or the path of a file of them.
    time : (n,) seconds since `epoch`, as in `Samples`.
    epoch : UTC moment of time zero.
    satellite : catalogue number, where the lines are of several satellites.

    Returns
    -------
    The columns latitude_deg, longitude_deg and altitude_m, (n,), geodetic, ready for
    `samples.with_columns(**positions)`. TEME is turned into Earth-fixed axes by mean sidereal
    time (Vallado et al., AIAA 2006-6753), without polar motion.

    Raises
    ------
    LogError for lines that are no elements, or that SGP4 cannot carry to these times;
    MissingExtraError without sgp4. Warns where elements are older than a week.

    Examples
    --------
    >>> lines = '''ISS (ZARYA)
    ... 1 25544U 98067A   21107.58244333  .00000946  00000-0  25412-4 0  9990
    ... 2 25544  51.6445 282.4828 0002680 236.8482 199.8666 15.48892929279202'''
    >>> where = positions_from_tle(lines, [0.0, 60.0], datetime(2021, 4, 17, 14, 0, tzinfo=UTC))
    >>> where["latitude_deg"].round(1).tolist(), (where["altitude_m"] / 1e3).round().tolist()
    ([51.0, 51.6], [428.0, 428.0])
    """
    try:
        from sgp4.api import Satrec
    except ImportError:
        raise MissingExtraError("positions from two-line elements", "space") from None
    lines = isinstance(tle, str) and "\n" in tle.strip()
    text = str(tle) if lines else read_bytes(tle).decode(errors="replace")
    sets = [Satrec.twoline2rv(*pair) for pair in _choose(_pairs(text), satellite)]
    start = epoch.replace(tzinfo=UTC) if epoch.tzinfo is None else epoch
    unix = start.timestamp() + np.asarray(time, dtype=np.float64)
    made = np.array([s.jdsatepoch + s.jdsatepochF - _UNIX_JULIAN_DATE for s in sets]) * DAY_S
    nearest = np.abs(unix[:, None] - made).argmin(axis=1) if len(sets) > 1 else np.zeros(len(unix))
    if (age := np.abs(unix - made[nearest.astype(int)]).max(initial=0.0) / DAY_S) > 7.0:
        warnings.warn(
            f"the elements are {age:.0f} days off: positions may be wrong by tens of kilometres; "
            "take elements of the same week",
            AgonicWarning,
            stacklevel=2,
        )
    position_i = np.empty((3, len(unix)))
    for k, elements in enumerate(sets):
        rows = nearest == k
        position_i[:, rows] = _propagate(elements, unix[rows])
    places = geodetic(rotate_about_third(position_i, sidereal_rad(unix)))
    return dict(zip(("latitude_deg", "longitude_deg", "altitude_m"), places, strict=True))


_NUMBERS = (
    ((18, 32), (33, 43)),
    ((8, 16), (17, 25), (26, 33), (34, 42), (43, 51), (52, 63)),
)
"""Where numbers stand in the first and second line (CelesTrak, "NORAD two-line element set")."""


def _pairs(text: str) -> list[tuple[str, str]]:
    """The first and second lines that belong together, checked by their checksums."""
    lines = [line.rstrip() for line in text.splitlines()]
    pairs = [
        (one[:69], two[:69])
        for one, two in pairwise(lines)
        if one.startswith("1 ") and two.startswith("2 ") and one[2:7] == two[2:7]
    ]
    if not pairs:
        raise LogError(
            "no two-line elements found; give two lines that begin with 1 and 2 and the same "
            "catalogue number"
        )
    from sgp4.io import compute_checksum

    for line in (line for pair in pairs for line in pair):
        if len(line) < 69 or line[-1] != str(compute_checksum(line)):
            raise LogError(f"the checksum of {line!r} is wrong; copy the elements again")
        numbers = (to_number(line[a:b]) for a, b in _NUMBERS[int(line[0]) - 1])
        if any(map(math.isnan, numbers)) or not (line.isascii() and line.isprintable()):
            raise LogError(f"{line!r} has letters where numbers belong; copy the elements again")
    return pairs


def _choose(pairs: Sequence[tuple[str, str]], satellite: int | None) -> list[tuple[str, str]]:
    """The elements of one satellite; an error naming those there are where that is not clear."""
    numbers = {one[2:7].strip().lstrip("0") for one, _ in pairs}
    wanted = str(satellite) if satellite is not None else next(iter(numbers))
    if wanted not in numbers or (satellite is None and len(numbers) > 1):
        raise LogError(f"elements of the satellites {', '.join(sorted(numbers))}; choose one")
    return [pair for pair in pairs if pair[0][2:7].strip().lstrip("0") == wanted]


def _propagate(elements: Any, unix: Array) -> Array:
    """Positions (3, n), m, in TEME."""
    days = np.floor(unix / DAY_S)
    errors, positions_km, _ = elements.sgp4_array(
        days + _UNIX_JULIAN_DATE, (unix - days * DAY_S) / DAY_S
    )
    if errors.any():
        from sgp4.api import SGP4_ERRORS

        why = SGP4_ERRORS.get(int(errors[errors > 0][0]), "SGP4 failed")
        raise LogError(
            f"the elements do not hold at {int((errors > 0).sum())} of {len(unix)} times ({why}); "
            "take elements of the same week"
        )
    return np.asarray(positions_km, dtype=np.float64).T * 1e3
