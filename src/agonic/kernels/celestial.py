"""How the Earth is turned under the stars, and where the Sun stands.

Times are UTC seconds since 1970. UTC stands for UT1, from which it never differs by more than
0.9 s: 420 m on the equator, less than two-line elements are good for.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_DAY_S = 86_400.0
_J2000_UNIX_S = 946_728_000.0  # 2000-01-01 12:00
_CENTURY_DAYS = 36_525.0


def sidereal_rad(unix_s: ArrayLike) -> Array:
    """Greenwich mean sidereal time, radians 0…2π: by how much Earth-fixed axes are turned.

    67310.54841 s + (876600 h + 8640184.812866 s) T + 0.093104 s T² − 6.2e-6 s T³, with T in
    centuries since 2000-01-01 12:00 UT1 (Aoki et al., Astronomy and Astrophysics 105, 1982).

    >>> float(np.degrees(sidereal_rad(946_728_000.0)).round(4))
    280.4606
    """
    days = (np.asarray(unix_s, dtype=np.float64) - _J2000_UNIX_S) / _DAY_S
    t = days / _CENTURY_DAYS
    # 876600 h a century is one turn a day: whole turns are taken off before digits are lost
    slow = 67_310.54841 + (8_640_184.812866 + (0.093104 - 6.2e-6 * t) * t) * t
    return np.asarray(2.0 * np.pi * ((days % 1.0 + slow / _DAY_S) % 1.0))


def turned(vectors: Array, angle_rad: ArrayLike) -> Array:
    """Vectors (3, n) in axes that are turned about the third by an angle (n,).

    Inertial vectors of date become Earth-fixed with the sidereal time (of TEME and the mean
    equinox alike, to arcseconds), Earth-fixed ones inertial with its negative.

    >>> turned(np.array([[1.0], [0.0], [5.0]]), [np.pi / 2]).round(9).ravel().tolist()
    [0.0, -1.0, 5.0]
    """
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    x, y, z = vectors
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, np.broadcast_to(z, x.shape)])


def sun_i(unix_s: ArrayLike) -> Array:
    """The direction of the Sun from the Earth (3, n), mean equator and equinox of date.

    Good to 0.01° from 1950 to 2050 (The Astronomical Almanac, section C, low-precision formulas).

    >>> at_equinox = sun_i([1_742_461_260.0])  # 2025-03-20 09:01 UTC
    >>> bool(np.abs(at_equinox.ravel() - [1.0, 0.0, 0.0]).max() < 2e-4)
    True
    """
    days = (np.asarray(unix_s, dtype=np.float64) - _J2000_UNIX_S) / _DAY_S
    anomaly = np.radians(357.528 + 0.9856003 * days)
    mean = np.radians(280.460 + 0.9856474 * days)
    longitude = mean + np.radians(1.915) * np.sin(anomaly) + np.radians(0.020) * np.sin(2 * anomaly)
    obliquity = np.radians(23.439 - 4e-7 * days)
    east = np.sin(longitude)
    return np.stack([np.cos(longitude), np.cos(obliquity) * east, np.sin(obliquity) * east])


def in_shadow(position_i: Array, sun_i: Array, radius_m: float) -> NDArray[np.bool_]:
    """Whether positions (3, n), m, lie in the cylinder of shadow behind a globe of that radius.

    >>> behind = np.array([[-7e6, -7e6, 7e6], [0.0, 6.5e6, 0.0], [0.0, 0.0, 0.0]])
    >>> in_shadow(behind, np.array([[1.0], [0.0], [0.0]]), 6.4e6).tolist()
    [True, False, False]
    """
    along = (position_i * sun_i).sum(axis=0)
    across2 = (position_i**2).sum(axis=0) - along**2
    return np.asarray((along < 0) & (across2 < radius_m**2))
