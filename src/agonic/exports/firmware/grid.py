"""`DeclinationGrid`: the world model's declination in a box of the globe, as a table.

The table holds the northern and eastern component of the field and not the declination itself:
these have no jump at ±180° and no singular place, so that a coarser table does (in a box from 60°
south to 60° north nodes every 5° are 0.3° off at worst, against 5° with a table of declinations).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.errors import AgonicError
from agonic.field.decimal_year import decimal_year
from agonic.field.place import choose_model
from agonic.readable import Readable

STEPS_DEG = (30.0, 20.0, 15.0, 10.0, 7.5, 5.0, 4.0, 3.0, 2.5, 2.0, 1.5, 1.0, 0.75, 0.5, 0.25)
MAX_NODES = 20_000
"""Nodes of a table, 80 kB: more than a controller spares."""
UNIT_NT = 2.0
"""nT per unit of the table's 16-bit numbers, which hold ±65 534 nT: 0.003° at mid latitudes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DeclinationGrid(Readable):
    """The horizontal field at the nodes of a regular grid, interpolated between them.

    Parameters
    ----------
    south, west : latitude of the first row, longitude of the first column, degrees.
    latitude_step, longitude_step : degrees, positive; rows go north, columns east.
    north, east : (rows, columns), components of the field, nT; kept in whole `UNIT_NT`.
    error_deg : the largest difference from the model that was found between the nodes.
    source : whose values, when.

    Examples
    --------
    >>> grid = DeclinationGrid(south=50.0, west=0.0, latitude_step=5.0, longitude_step=10.0,
    ...                        north=[[20e3, 20e3], [20e3, 20e3]], east=[[0, 2e3], [0, 2e3]],
    ...                        source="a chart")
    >>> declination, outside = grid.at(52.5, 5.0)
    >>> declination.round(3), outside
    (np.float64(2.862), np.False_)
    """

    south: float
    west: float
    latitude_step: float
    longitude_step: float
    north: Array
    east: Array
    error_deg: float | None = None
    source: str

    def __post_init__(self) -> None:
        if not (self.latitude_step > 0 and self.longitude_step > 0):
            raise AgonicError("the steps of a grid are positive: rows go north, columns east")
        for name in ("north", "east"):
            values = np.rint(np.asarray(getattr(self, name), dtype=np.float64) / UNIT_NT)
            shaped = values.ndim == 2 and min(values.shape) >= 2
            if not (shaped and (np.abs(values) < 2**15).all()):
                raise AgonicError(
                    f"{name} needs components in nT, two rows and columns or more, none of them "
                    "missing"
                )
            values *= UNIT_NT
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if self.north.shape != self.east.shape:
            raise AgonicError(f"north is {self.north.shape} and east {self.east.shape}")

    def at(self, latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> tuple[Array, Array]:
        """Declination, degrees, and whether the place is outside, where the nearest edge counts.

        Parameters: latitude_deg (…), longitude_deg (…), degrees; returns two arrays (…).
        """
        rows, columns = (n - 1 for n in self.north.shape)
        row = (np.asarray(latitude_deg, dtype=np.float64) - self.south) / self.latitude_step
        longitude = np.asarray(longitude_deg, dtype=np.float64)
        known = np.abs(longitude) <= 540.0  # a turn beyond the date line: more are no degrees
        around = (np.where(known, longitude, self.west) - self.west) % 360.0
        column = np.where(known, around / self.longitude_step, 0.0)
        beyond = column - columns
        outside = ~((row >= 0) & (row <= rows) & (beyond <= 0) & known)
        nearer_west = beyond > 360.0 / self.longitude_step - column
        column = np.where(beyond > 0, np.where(nearer_west, 0.0, columns), column)
        row = np.where(row >= 0, np.minimum(row, rows), 0.0)
        north, east = (_bilinear(table, row, column) for table in (self.north, self.east))
        return np.degrees(np.arctan2(east, north)), outside


def declination_grid(
    latitude_deg: tuple[float, float],
    longitude_deg: tuple[float, float],
    date: str,
    *,
    tolerance_deg: float = 0.1,
) -> DeclinationGrid:
    """The coarsest table that follows the world model to `tolerance_deg` in a box.

    Parameters
    ----------
    latitude_deg : southern and northern edge.
    longitude_deg : western and eastern edge; (170, −170) crosses the date line, (−180, 180) is
        all round.
    date : for the model, 2026-05-01: WMM2025 in its years, else IGRF, at sea level.
    tolerance_deg : how far interpolation may be from the model, which errs itself.

    Raises `AgonicError` for a box without area, and where a magnetic pole in it turns the
    declination faster than a table can follow.

    >>> grid = declination_grid((45.0, 55.0), (0.0, 20.0), "2026-05-01")
    >>> grid.north.shape, grid.error_deg < 0.1
    ((3, 4), True)
    """
    south, west, height, width = _box(latitude_deg, longitude_deg)
    world = choose_model(float(decimal_year(date)))
    source = f"{world.name} on {date} at 0 m"
    worst, largest = (south, west), np.inf
    for step in STEPS_DEG:
        rows, columns = (max(1, int(np.ceil(side / step - 1e-9))) for side in (height, width))
        if (rows + 1) * (columns + 1) > MAX_NODES:
            break
        # half steps: every second one is a node, and between nodes the error is largest
        latitudes = south + height * np.linspace(0.0, 1.0, 2 * rows + 1)
        longitudes = west + width * np.linspace(0.0, 1.0, 2 * columns + 1)
        places = np.meshgrid(latitudes, (longitudes + 180.0) % 360.0 - 180.0, indexing="ij")
        there = world.at(*places, 0.0, date)
        grid = DeclinationGrid(
            south=south,
            west=west,
            latitude_step=height / rows,
            longitude_step=width / columns,
            north=there.north[::2, ::2],
            east=there.east[::2, ::2],
            source=source,
        )
        turn = grid.at(*places)[0] - there.declination_deg
        error = np.abs((turn + 180.0) % 360.0 - 180.0)
        largest = float(error.max())
        if largest <= tolerance_deg:
            within = f"{source}, interpolated to within {largest:.2g} deg"
            return replace(grid, error_deg=largest, source=within)
        worst = (float(places[0].ravel()[error.argmax()]), float(places[1].ravel()[error.argmax()]))
    raise AgonicError(
        f"near latitude {worst[0]:.0f}, longitude {worst[1]:.0f} the declination turns too fast "
        f"for a table to follow to {tolerance_deg:g} deg (still {largest:.2g} deg off): leave "
        "that place out of the box, or raise the tolerance"
    )


def _box(
    latitude_deg: tuple[float, float], longitude_deg: tuple[float, float]
) -> tuple[float, float, float, float]:
    """Southern and western edge, height and width, degrees."""
    (south, north), (west, east) = map(float, latitude_deg), map(float, longitude_deg)
    width = (east - west) % 360.0
    if width == 0.0 and east != west:
        width = 360.0
    if not (-90.0 <= south < north <= 90.0 and width > 0.0):
        raise AgonicError(
            f"latitudes {south:g} to {north:g} and longitudes {west:g} to {east:g} are not a box: "
            "give the southern and northern, then the western and eastern edge, degrees"
        )
    return south, west, north - south, width


def _bilinear(table: Array, row: Array, column: Array) -> Array:
    """The table between its nodes, at fractional rows and columns inside it."""
    i = np.minimum(row.astype(int), len(table) - 2)
    j = np.minimum(column.astype(int), len(table[0]) - 2)
    up, along = row - i, column - j
    south = table[i, j] + along * (table[i, j + 1] - table[i, j])
    north = table[i + 1, j] + along * (table[i + 1, j + 1] - table[i + 1, j])
    return np.asarray(south + up * (north - south))
