"""Where a star is seen: annual and diurnal aberration, and refraction by the air.

A star sensor finds its attitude from where it sees stars. One that takes no account of this takes
the whole field of view to be where its stars would be without: its attitude is turned by the same
small angle, for neither effect has a turn about the boresight (both are gradients).
"""

from __future__ import annotations

from typing import NamedTuple

import erfa
import numpy as np

from agonic.arrays import Array
from agonic.maths.earth.earth_rotation import TT_TAI_S, UNIX_JD, spline_series, tai_utc_s
from agonic.maths.earth.geodesy import SEMI_MAJOR_M

_AU_PER_DAY_IN_C = 1 / 173.1446326846693
_EQUATOR_IN_C = 7.292115e-5 * SEMI_MAJOR_M / 299_792_458.0
"""Speed of the equator, as a share of that of light."""
LOWEST_DEG = 85.0
"""Zenith distance below which the formula of refraction does not hold; it stays the same beyond."""


class Air(NamedTuple):
    """The air at a site: hPa, °C, relative humidity 0…1, and the wavelength of the light, µm."""

    pressure_hPa: float = 1013.25
    temperature_C: float = 15.0
    humidity: float = 0.5
    wavelength_um: float = 0.6


def observer_velocity_i(unix_s: Array, east_i: Array, latitude_deg: float) -> Array:
    """The velocity (n, 3) of a site on the turning and orbiting Earth, as a share of light's.

    `east_i` (n, 3) points east at the site, inertial components.

    Source: ERFA's `epv00` for the Earth about the barycentre of the solar system."""
    orbiting = spline_series(unix_s + tai_utc_s(unix_s) + TT_TAI_S, _barycentric)
    turning = _EQUATOR_IN_C * np.cos(np.radians(latitude_deg)) * east_i
    return np.asarray(orbiting * _AU_PER_DAY_IN_C + turning)


def _barycentric(tt_days: Array) -> Array:
    """The Earth's velocity about the barycentre of the solar system (n, 3), au a day."""
    return np.asarray(erfa.epv00(UNIX_JD, tt_days)[1]["v"])


def apply_aberration(directions_i: Array, velocity_i: Array) -> Array:
    """Unit directions (n, 3) as a moving observer sees them, shifted towards the motion.

    Source: ERFA's `ab`, special relativity; the part that the Sun's gravity adds is left out.
    """
    slower = np.sqrt(1 - (velocity_i**2).sum(axis=-1))
    return np.asarray(erfa.ab(directions_i, velocity_i, np.ones(len(directions_i)), slower))


def refraction_rad(zenith_rad: Array, air: Air) -> Array:
    """How much higher than without air a star is seen at true zenith distances (n,), rad.

    z_true = z + A tan z + B tan³ z, A and B of ERFA's `refco`, solved for the seen z by Newton's
    method."""
    a, b = erfa.refco(*air)
    true = np.minimum(zenith_rad, np.radians(LOWEST_DEG))
    seen = true
    for _ in range(3):
        t = np.tan(seen)
        excess = seen + a * t + b * t**3 - true
        seen = seen - excess / (1 + (a + 3 * b * t**2) * (1 + t**2))
    return np.asarray(true - seen)


def apply_refraction(directions: Array, up: Array, air: Air) -> Array:
    """Unit directions (n, 3) raised towards the unit vectors `up` (n, 3) by refraction."""
    height = (directions * up).sum(axis=-1)
    level = directions - height[:, None] * up
    sine = np.linalg.norm(level, axis=-1)
    zenith = np.arctan2(sine, height)
    seen = zenith - refraction_rad(zenith, air)
    away = level / np.maximum(sine, 1e-12)[:, None]
    return np.asarray(np.cos(seen)[:, None] * up + np.sin(seen)[:, None] * away)
