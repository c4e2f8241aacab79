"""Geodetic positions on WGS-84, and vectors between Earth-fixed and north-east-down axes.

Components come first, (3, n), so that each is one contiguous row; nothing divides by cos φ, so the
poles are points like any other: north there is the direction that the given longitude leaves open.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array

SEMI_MAJOR_M = 6_378_137.0
FLATTENING = 1.0 / 298.257223563
"""WGS-84: NIMA TR8350.2."""


def directions(latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> Array:
    """sin φ, cos φ, sin λ, cos λ of geodetic positions, (4, n), of which the others are made."""
    # One tangent of the half angle gives both to the last digit, and NumPy vectorises the tangent.
    half = np.tan(np.stack([latitude_deg, longitude_deg]) * (np.pi / 360.0))
    versine = 2.0 / (1.0 + half**2)
    return np.stack([half * versine, versine - 1.0], axis=1).reshape(4, -1)


def earth_fixed_position(where: Array, altitude_m: ArrayLike) -> Array:
    """Earth-fixed position (3, n), m, of `directions` and the height above the ellipsoid.

    (N + h) cos φ (cos λ, sin λ) and (N (1 − e²) + h) sin φ, with N = a / √(1 − e² sin² φ)."""
    sin_latitude, cos_latitude, sin_longitude, cos_longitude = where
    eccentricity2 = FLATTENING * (2.0 - FLATTENING)
    normal = SEMI_MAJOR_M / np.sqrt(1.0 - eccentricity2 * sin_latitude**2)
    from_axis = (normal + altitude_m) * cos_latitude
    along_axis = (normal * (1.0 - eccentricity2) + altitude_m) * sin_latitude
    return np.stack([from_axis * cos_longitude, from_axis * sin_longitude, along_axis])


def north_east_down(vectors_e: Array, where: Array) -> Array:
    """Earth-fixed vectors (…, 3, n) in the north-east-down axes of `directions` (4, n)."""
    sin_latitude, cos_latitude, sin_longitude, cos_longitude = where
    x, y, z = vectors_e[..., 0, :], vectors_e[..., 1, :], vectors_e[..., 2, :]
    outward = cos_longitude * x + sin_longitude * y
    turned = np.empty(vectors_e.shape)
    turned[..., 0, :] = cos_latitude * z - sin_latitude * outward
    turned[..., 1, :] = cos_longitude * y - sin_longitude * x
    turned[..., 2, :] = -cos_latitude * outward - sin_latitude * z
    return turned


def earth_fixed(vectors_n: Array, where: Array) -> Array:
    """North-east-down vectors (…, 3, n) at `directions` (4, n) in Earth-fixed axes."""
    sin_latitude, cos_latitude, sin_longitude, cos_longitude = where
    north, east, down = vectors_n[..., 0, :], vectors_n[..., 1, :], vectors_n[..., 2, :]
    outward = -sin_latitude * north - cos_latitude * down
    turned = np.empty(vectors_n.shape)
    turned[..., 0, :] = cos_longitude * outward - sin_longitude * east
    turned[..., 1, :] = sin_longitude * outward + cos_longitude * east
    turned[..., 2, :] = cos_latitude * north - sin_latitude * down
    return turned


def geodetic(position_e: Array) -> tuple[Array, Array, Array]:
    """Geodetic latitude and longitude, degrees, and height, m, of Earth-fixed positions (3, n).

    tan φ = (z + e′² b sin³ β) / (ρ − e² a cos³ β) with tan β = (1 − f) tan φ, begun with
    tan β = z (b + e′² b² / r) / (a ρ) and repeated once: below 1e-11 degrees from 10 km under the
    ground to 1e9 m above it (Bowring, Survey Review 28, 1985)."""
    x, y, z = position_e
    from_axis, distance = np.hypot(x, y), np.sqrt(x**2 + y**2 + z**2)
    semi_minor = SEMI_MAJOR_M * (1.0 - FLATTENING)
    eccentricity2 = FLATTENING * (2.0 - FLATTENING)
    second2 = eccentricity2 / (1.0 - eccentricity2)
    rise = z * (semi_minor + second2 * semi_minor**2 / distance)
    beta = np.arctan2(rise, SEMI_MAJOR_M * from_axis)
    for _ in range(2):
        up = z + second2 * semi_minor * np.sin(beta) ** 3
        out = from_axis - eccentricity2 * SEMI_MAJOR_M * np.cos(beta) ** 3
        beta = np.arctan2((1.0 - FLATTENING) * up, out)
    latitude = np.arctan2(up, out)
    sine, cosine = np.sin(latitude), np.cos(latitude)
    surface = SEMI_MAJOR_M * np.sqrt(1.0 - eccentricity2 * sine**2)
    height = from_axis * cosine + z * sine - surface
    return np.degrees(latitude), np.degrees(np.arctan2(y, x)), height


def from_geocentric(
    latitude_deg: ArrayLike, longitude_deg: ArrayLike, radius_m: ArrayLike
) -> tuple[Array, Array, Array]:
    """Geodetic latitude, longitude and height of geocentric latitude, longitude and radius.

    The latitudes differ by up to 0.19°, and a radius is no height by 6 357 to 6 378 km."""
    outward = directions(latitude_deg, longitude_deg)
    sin_latitude, cos_latitude, sin_longitude, cos_longitude = outward
    axes = np.stack([cos_latitude * cos_longitude, cos_latitude * sin_longitude, sin_latitude])
    return geodetic(np.asarray(radius_m, dtype=np.float64) * axes)
