"""What the field should be at each sample, and the declination there."""

from __future__ import annotations

from datetime import timedelta
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.calibration.setup import Setup
from agonic.errors import LogError, ValidityError
from agonic.field.decimal_year import decimal_year
from agonic.field.place import choose_model
from agonic.headings.attitude import select_rows
from agonic.maths.earth.geodesy import SEMI_MAJOR_M
from agonic.samples import Samples

_ALL = slice(None)


class Surroundings(NamedTuple):
    """Declination and its sd, degrees, and intensities to expect, nT or `None`; (n,) or (1,)."""

    declination_deg: Array
    declination_sd_deg: Array
    horizontal: Array | None
    vertical: Array | None
    notes: tuple[str, ...] = ()

    def compare(
        self, horizontal: Array, vertical: Array, good: Mask | Index, rows: slice | Index = _ALL
    ) -> tuple[Array, Array]:
        """Strength over the expected one, and dip less the expected one, rad, of the field of some
        rows; where none is expected, over and less the medians of the `good` ones among them."""
        size, dip = np.hypot(horizontal, vertical), np.arctan2(vertical, horizontal)
        if self.horizontal is None or self.vertical is None:
            return size / np.median(size[good]), dip - np.median(dip[good])
        level, below = (select_rows(one, rows) for one in (self.horizontal, self.vertical))
        return size / np.hypot(level, below), dip - np.arctan2(below, level)

    def find_dip_tangent(self, rows: slice) -> Array | None:
        """Of the place, where it is known."""
        if self.horizontal is None or self.vertical is None:
            return None
        return select_rows(self.vertical, rows) / np.maximum(select_rows(self.horizontal, rows), 1)


def find_surroundings(samples: Samples, setup: Setup) -> Surroundings:
    """Declination and intensities: the setup's own, else those of the world model on the track.

    Raises LogError where the declination has to come from the model and the samples lack place or
    date, ValidityError where the date is outside every model.
    """
    given = setup.declination_deg is not None and setup.horizontal is not None
    notes: tuple[str, ...] = ()
    try:
        world = None if given else evaluate_world(samples)
    except ValidityError as error:
        if setup.declination_deg is None:
            raise
        world, notes = None, (f"what the field should be is not known: {error}",)
    around = Surroundings(np.zeros(1), np.zeros(1), None, None) if world is None else world
    if setup.declination_deg is not None:
        declination = np.array([setup.declination_deg])
        sd = np.array([setup.declination_sd_deg or 0.0])
        around = around._replace(declination_deg=declination, declination_sd_deg=sd)
    elif world is None:
        lacking = {}
        if samples.latitude_deg is None or samples.longitude_deg is None:
            lacking["position"] = "the place (--at LAT,LON)"
        if samples.epoch is None:
            lacking["date"] = "the date (--date 2026-05-01)"
        raise LogError(
            f"true heading needs the declination, and the samples of {samples.name} have no "
            f"{' and no '.join(lacking)} to take it from: give {' and '.join(lacking.values())}, "
            "or a declination in the setup (0 for headings from magnetic north)"
        )
    if setup.horizontal is not None and setup.vertical is not None:
        h, z = np.array([setup.horizontal]), np.array([setup.vertical])
        around = around._replace(horizontal=h, vertical=z)
    return around._replace(notes=notes)


def evaluate_world(samples: Samples) -> Surroundings | None:
    """The world model along the track of the samples; `None` where they lack place or date."""
    latitude, longitude, epoch = samples.latitude_deg, samples.longitude_deg, samples.epoch
    if latitude is None or longitude is None or epoch is None:
        return None
    n = len(samples)
    # rows at which the world model is asked; between them it is linear in time
    even = np.linspace(0, n - 1, 257).round().astype(np.intp)
    # after which the place is another: a fix that came, or a log put together
    north, east = np.diff(np.radians(latitude)), np.diff(np.radians(longitude))
    east = ((east * np.cos(np.radians(latitude[1:]))) + np.pi) % (2 * np.pi) - np.pi
    # rows further apart than this are asked both, so that nothing is interpolated between them
    before = np.flatnonzero(np.hypot(north, east) * SEMI_MAJOR_M > 1000.0)
    rows = np.unique(np.concatenate([even, before, before + 1]))
    time = np.zeros(n) if samples.time is None else samples.time
    altitude = np.zeros(n) if samples.altitude_m is None else samples.altitude_m
    ends = decimal_year([epoch + timedelta(seconds=float(s)) for s in time[rows[[0, -1]]]])
    share = (time[rows] - time[0]) / max(time[-1] - time[0], 1e-9)
    years = ends[0] + share * (ends[1] - ends[0])
    there = choose_model(float(years[len(years) // 2])).at(
        latitude[rows], longitude[rows], altitude[rows], years
    )
    where = np.arange(n) if samples.time is None else time
    declination = np.unwrap(there.declination_deg, period=360.0)
    nodes = (declination, there.declination_sd_deg, there.horizontal, there.down)
    east, sd, level, below = (np.interp(where, where[rows], values) for values in nodes)
    return Surroundings(east, sd, level, below)
