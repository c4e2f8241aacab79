"""The elementary rotations of astronomy and geodesy, and the frames that they make.

They are passive: r′ = R_i(v) r gives the components of the same vector in axes that are turned
about axis i by the angle v. SciPy's are active: R3(c) R2(b) R3(a) is
`Rotation.from_euler("ZYZ", [a, b, c]).inv()`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array

ARCSEC_RAD = np.pi / 180 / 3600


def r2(angle_rad: ArrayLike) -> Array:
    """R2(v) = [[c, 0, −s], [0, 1, 0], [s, 0, c]], (…, 3, 3)."""
    return _about(1, angle_rad)


def r3(angle_rad: ArrayLike) -> Array:
    """R3(v) = [[c, s, 0], [−s, c, 0], [0, 0, 1]], (…, 3, 3)."""
    return _about(2, angle_rad)


def _about(axis: int, angle_rad: ArrayLike) -> Array:
    angle = np.asarray(angle_rad, dtype=np.float64)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.zeros((*angle.shape, 3, 3))
    matrix[..., axis, axis] = 1.0
    matrix[..., i, i] = matrix[..., j, j] = np.cos(angle)
    matrix[..., i, j] = np.sin(angle)
    matrix[..., j, i] = -matrix[..., i, j]
    return matrix


def rot_en(latitude_deg: ArrayLike, longitude_deg: ArrayLike) -> Array:
    """R3(−Λ) R2(90° + Φ): north-east-down components at a site into Earth-fixed ones.

    Φ and Λ are where the plumb line points, the astronomical latitude and longitude (east
    positive); with geodetic ones down is square to the ellipsoid instead."""
    return r3(-np.radians(longitude_deg)) @ r2(np.radians(90.0 + np.asarray(latitude_deg)))


def rot_ci(ra_deg: ArrayLike, dec_deg: ArrayLike, rot_deg: ArrayLike) -> Array:
    """R3(Rot) R2(90° − Dec) R3(Ra): inertial components into those of a star sensor.

    The third row is the boresight. With Rot = 0 the first axis points south, to decreasing
    declination."""
    return from_323_deg(ra_deg, 90.0 - np.asarray(dec_deg), rot_deg)


def rot_cn(azimuth_deg: ArrayLike, elevation_deg: ArrayLike, roll_deg: ArrayLike) -> Array:
    """North-east-down components into those of a star sensor that looks at a place in the sky.

    R3(roll) R2(90° − elevation) R3(−azimuth) after north-west-up: as `rot_ci` with the horizon for
    the equator, so with roll 0 the first axis points to the horizon below."""
    to_nwu = np.diag([1.0, -1.0, -1.0])
    return (
        from_323_deg(-np.asarray(azimuth_deg), 90.0 - np.asarray(elevation_deg), roll_deg) @ to_nwu
    )


def from_323_deg(alpha: ArrayLike, beta: ArrayLike, gamma: ArrayLike) -> Array:
    """R3(γ) R2(β) R3(α), degrees, (…, 3, 3)."""
    return r3(np.radians(gamma)) @ r2(np.radians(beta)) @ r3(np.radians(alpha))


def angles_323_deg(matrix: Array) -> Array:
    """α, β, γ (…, 3) of R3(γ) R2(β) R3(α), degrees, β from 0 to 180.

    With β = 0 or 180° only α + γ or α − γ means anything; γ is 0 there."""
    level = np.hypot(matrix[..., 2, 0], matrix[..., 2, 1])
    pole = level < 1e-12
    alpha = np.where(
        pole,
        np.arctan2(-matrix[..., 1, 0], matrix[..., 1, 1]),
        np.arctan2(matrix[..., 2, 1], matrix[..., 2, 0]),
    )
    gamma = np.where(pole, 0.0, np.arctan2(matrix[..., 1, 2], -matrix[..., 0, 2]))
    beta = np.arctan2(level, matrix[..., 2, 2])
    return np.asarray(np.degrees(np.stack([alpha, beta, gamma], axis=-1)))


def angles_232_deg(matrix: Array) -> Array:
    """χ, ζ, η (…, 3) of R2(η) R3(ζ) R2(χ), degrees, η from −90 to 90.

    R3(−Λ) R2(90° + Φ) has χ = 90° + Φ, ζ = −Λ and η = 0. With ζ = 0 or 180° only χ + η or χ − η
    means anything; η is 0 there."""
    level = np.hypot(matrix[..., 1, 0], matrix[..., 1, 2])
    eta = np.arctan2(matrix[..., 2, 1], matrix[..., 0, 1])
    side = np.where(np.cos(eta) < 0, -1.0, 1.0)  # of the two triples the one with the smaller η
    pole = level < 1e-12
    chi = np.where(
        pole,
        np.arctan2(matrix[..., 2, 0], matrix[..., 2, 2]),
        np.arctan2(side * matrix[..., 1, 2], -side * matrix[..., 1, 0]),
    )
    zeta = np.arctan2(side * level, matrix[..., 1, 1])
    eta = np.where(pole, 0.0, np.arctan2(side * matrix[..., 2, 1], side * matrix[..., 0, 1]))
    return np.asarray(np.degrees(np.stack([chi, zeta, eta], axis=-1)))
