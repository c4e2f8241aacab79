"""`DiSheet`: an absolute measurement with a fluxgate theodolite, as its observer wrote it down."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.provenance import Input


@dataclass(frozen=True, kw_only=True, eq=False)
class DiSheet:
    """Readings of a DI-flux measurement, angles in degrees.

    Parameters
    ----------
    mark_deg : (m,) readings of the circle to the azimuth mark, both faces. mark_azimuth_deg : where
        that is, clockwise from true north, if known.
    horizontal_deg, zenith_deg, reading : (n,) of both circles and of the fluxgate.
    setting : (n,) the number of the setting of each reading: repeats share one.
    time : UTC seconds since 1970, (n,). magnitude : of the field at the pillar, nT, if known.
    """

    mark_deg: Array
    horizontal_deg: Array
    zenith_deg: Array
    reading: Array
    setting: NDArray[np.int64]
    time: Array
    mark_azimuth_deg: float | None = None
    magnitude: float | None = None
    pillar: str = ""
    theodolite: str = ""
    sensor: str = ""
    name: str = ""
    sources: tuple[Input, ...] = ()
    notes: tuple[str, ...] = ()
