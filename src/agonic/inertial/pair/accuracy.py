"""How far the errors of both calibrations turn the azimuth of the body's x axis, and its slope."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.inertial.maths.shots import DIP, SIGHT, differentiate, observe, split

STEEPEST_DEG = 60.0
_PITCHES = np.arange(-STEEPEST_DEG, STEEPEST_DEG + 1.0, 30.0)
_AROUND = np.arange(0.0, 360.0, 45.0)


class Attitudes(NamedTuple):
    """Up and field (k, 3) in the accelerometer's axes, and azimuth, pitch and roll (k, 3), degrees.

    The angles are those of an instrument whose x axis is the sight.
    """

    up: Array
    field: Array
    angles_deg: Array


def face(unknowns: Array, body: Array, angles_deg: Array) -> Attitudes:
    """What the sensors should see in attitudes by azimuth, pitch and roll (k, 3), degrees.

    `body` (3, 3) turns components in the accelerometer's axes into the instrument's.
    """
    rot_nb = Rotation.from_euler("ZYX", angles_deg, degrees=True)
    dip = unknowns[DIP]
    up = rot_nb.apply([0.0, 0.0, -1.0], inverse=True) @ body
    field = rot_nb.apply([np.cos(dip), 0.0, np.sin(dip)], inverse=True) @ body
    return Attitudes(up, field, angles_deg)


def list_directions() -> Array:
    """Azimuth, pitch and roll (k, 3), degrees, of all directions within 60° of level."""
    grid = np.meshgrid(_AROUND, _PITCHES, _AROUND, indexing="ij")
    return np.stack([part.ravel() for part in grid], axis=1).astype(np.float64)


def differentiate_direction(attitudes: Attitudes, unknowns: Array, sighted: bool) -> Array:
    """∂(slope, azimuth of the sight)/∂(unknowns), (k, 2, q), targets' own unknowns left out."""
    targets = (len(unknowns) - SIGHT.stop) // 2
    channels = observe(attitudes.up, attitudes.field, unknowns[SIGHT])
    jacobian = differentiate(channels, unknowns, attitudes.up, attitudes.field, targets)[:, 3:]
    if not sighted:
        jacobian[:, :, SIGHT] = 0.0
    return jacobian


def average_information(jacobian: Array, angles_deg: Array) -> tuple[Array, Array]:
    """Mean of jᵀj (q, q) of slope and azimuth over attitudes, each as large a part of all."""
    weight = np.cos(np.radians(angles_deg[:, 1]))
    weight = weight / weight.sum()
    slope, azimuth = (np.einsum("k,ki,kj->ij", weight, j, j) for j in np.swapaxes(jacobian, 0, 1))
    return slope, azimuth


def split_turn(unknowns: Array) -> Array:
    """The rotation (3, 3) from the magnetometer's axes to the accelerometer's, by polar parts."""
    left, _, right = np.linalg.svd(split(unknowns)[3])
    return np.asarray(left @ right)
