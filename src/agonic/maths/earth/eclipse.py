"""Whether the Sun shines on a position, or the Earth is before it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Mask
from agonic.maths.earth.earth_rotation import is_in_shadow, rotate_about_third, sidereal_rad, sun_i
from agonic.maths.earth.geodesy import SEMI_MAJOR_M, directions, earth_fixed_position

_BLOCK = 1 << 17  # rows at a time, so that ten million take no more memory than these


def find_eclipsed(
    latitude_deg: ArrayLike, longitude_deg: ArrayLike, altitude_m: ArrayLike, unix_s: ArrayLike
) -> Mask:
    """Whether positions (n,) lie in the Earth's shadow at UTC moments, seconds since 1970.

    The shadow is a cylinder as wide as the equator, without penumbra and refraction: in a low orbit
    its edges are good to about ten seconds."""
    latitude, longitude, altitude, unix = np.broadcast_arrays(
        *(
            np.asarray(v, dtype=np.float64)
            for v in (latitude_deg, longitude_deg, altitude_m, unix_s)
        )
    )
    dark = np.empty(len(latitude), dtype=bool)
    for start in range(0, len(dark), _BLOCK):
        rows = slice(start, start + _BLOCK)
        position_e = earth_fixed_position(
            directions(latitude[rows], longitude[rows]), altitude[rows]
        )
        sun_e = rotate_about_third(sun_i(unix[rows]), sidereal_rad(unix[rows]))
        dark[rows] = is_in_shadow(position_e, sun_e, SEMI_MAJOR_M)
    return dark
