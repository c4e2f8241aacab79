"""How the Earth is turned under the stars, and where the Sun stands.

Times are UTC seconds since 1970. `rot_ei` is the whole chain of the IAU to a thousandth of an
arcsecond and takes polar motion and UT1 as published. In the short formulas of the Sun and of mean
sidereal time UTC stands for UT1, from which it never differs by more than 0.9 s: 420 m on the
equator, less than two-line elements are good for.
"""

from __future__ import annotations

from collections.abc import Callable

import erfa
import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Mask
from agonic.units import DAY_S

_J2000_UNIX_S = 946_728_000.0  # 2000-01-01 12:00
_CENTURY_DAYS = 36_525.0
UNIX_JD = 2_440_587.5  # 1970-01-01 0 h
TT_TAI_S = 32.184
_NODE_S = 21_600.0
"""Precession and nutation are splined over 6 h: to 1e-4 mas of the series themselves."""


def tai_utc_s(unix_s: ArrayLike) -> Array:
    """TAI − UTC, s: the leap seconds since 1972, from ERFA's list."""
    table = erfa.leap_seconds.get()
    table = table[table["year"] >= 1972]  # before, UTC ran at a rate of its own
    begins = [f"{row['year']:04d}-{row['month']:02d}-01" for row in table]
    starts = np.array(begins, dtype="datetime64[s]").astype(np.float64)
    at = np.searchsorted(starts, np.asarray(unix_s, dtype=np.float64), side="right") - 1
    return np.asarray(table["tai_utc"][np.maximum(at, 0)], dtype=np.float64)


def rot_ei(
    unix_s: ArrayLike, ut1_tai_s: ArrayLike, pole_x_rad: ArrayLike, pole_y_rad: ArrayLike
) -> Array:
    """Inertial (GCRS) components into Earth-fixed (ITRS) ones, matrices (n, 3, 3).

    R2(−xp) R1(−yp) R3(s′) · R3(ERA) · C(X, Y, s): polar motion, the Earth's rotation about the
    celestial intermediate pole, precession and nutation of IAU 2006/2000A (IERS Conventions 2010,
    chapter 5). `unix_s` (n,) UTC; UT1 − TAI, s, and the pole, rad, as published for each moment.
    Where there are more moments than nodes 6 h apart, X, Y and s are splined over the nodes.

    Source: ERFA's `c2t06a`, which this equals to 0.001 mas (Wallace & Capitaine, Astronomy and
    Astrophysics 459, 2006)."""
    utc = np.atleast_1d(np.asarray(unix_s, dtype=np.float64))
    tai = utc + tai_utc_s(utc)
    x, y, s = spline_series(tai + TT_TAI_S, _intermediate_pole).T
    angle = erfa.era00(UNIX_JD, (tai + np.asarray(ut1_tai_s)) / DAY_S)
    sp = erfa.sp00(UNIX_JD, (tai + TT_TAI_S) / DAY_S)
    wobble = erfa.pom00(np.broadcast_to(pole_x_rad, utc.shape), pole_y_rad, sp)
    return np.asarray(erfa.c2tcio(erfa.c2ixys(x, y, s), angle, wobble))


def spline_series(tt_s: Array, series: Callable[[Array], Array]) -> Array:
    """A slow series (n, k) at seconds of TT since 1970, splined over 6 h where that is less work.

    `series` takes days of TT since 1970 and is called for the moments themselves where there are
    fewer of them than nodes.
    """
    from scipy.interpolate import CubicSpline  # slow to load

    first, last = np.floor(tt_s.min() / _NODE_S) - 2, np.ceil(tt_s.max() / _NODE_S) + 2
    if last - first >= len(tt_s):
        return series(tt_s / DAY_S)
    nodes = np.arange(first, last + 1) * _NODE_S
    return np.asarray(CubicSpline(nodes, series(nodes / DAY_S))(tt_s))


def _intermediate_pole(tt_days: Array) -> Array:
    """X, Y and s (n, 3) at days of TT since 1970."""
    return np.stack(erfa.xys06a(UNIX_JD, tt_days), axis=1)


def sidereal_rad(unix_s: ArrayLike) -> Array:
    """Greenwich mean sidereal time, radians 0…2π: by how much Earth-fixed axes are turned.

    67310.54841 s + (876600 h + 8640184.812866 s) T + 0.093104 s T² − 6.2e-6 s T³, with T in
    centuries since 2000-01-01 12:00 UT1 (Aoki et al., Astronomy and Astrophysics 105, 1982)."""
    days = (np.asarray(unix_s, dtype=np.float64) - _J2000_UNIX_S) / DAY_S
    t = days / _CENTURY_DAYS
    # 876600 h a century is one turn a day: whole turns are taken off before digits are lost
    slow = 67_310.54841 + (8_640_184.812866 + (0.093104 - 6.2e-6 * t) * t) * t
    return np.asarray(2.0 * np.pi * ((days % 1.0 + slow / DAY_S) % 1.0))


def rotate_about_third(vectors: Array, angle_rad: ArrayLike) -> Array:
    """Vectors (3, n) in axes that are turned about the third by an angle (n,).

    Inertial vectors of date become Earth-fixed with the sidereal time (of TEME and the mean
    equinox alike, to arcseconds), Earth-fixed ones inertial with its negative."""
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    x, y, z = vectors
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, np.broadcast_to(z, x.shape)])


def sun_i(unix_s: ArrayLike) -> Array:
    """The direction of the Sun from the Earth (3, n), mean equator and equinox of date.

    Good to 0.01° from 1950 to 2050 (The Astronomical Almanac, section C, low-precision formulas).
    """
    days = (np.asarray(unix_s, dtype=np.float64) - _J2000_UNIX_S) / DAY_S
    anomaly = np.radians(357.528 + 0.9856003 * days)
    mean = np.radians(280.460 + 0.9856474 * days)
    longitude = mean + np.radians(1.915) * np.sin(anomaly) + np.radians(0.020) * np.sin(2 * anomaly)
    obliquity = np.radians(23.439 - 4e-7 * days)
    east = np.sin(longitude)
    return np.stack([np.cos(longitude), np.cos(obliquity) * east, np.sin(obliquity) * east])


def is_in_shadow(position_i: Array, sun_i: Array, radius_m: float) -> Mask:
    """Whether positions (3, n), m, lie in the cylinder of shadow behind a globe of that radius."""
    along = (position_i * sun_i).sum(axis=0)
    across2 = (position_i**2).sum(axis=0) - along**2
    return np.asarray((along < 0) & (across2 < radius_m**2))
