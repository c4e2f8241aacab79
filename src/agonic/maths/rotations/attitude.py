"""Aerospace attitudes (heading about down, then pitch, then roll), as matrices and back.

Body axes forward, right, down; n axes north, east, down; `rot_nb` takes body components into n.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


def rot_nb(roll_deg: ArrayLike, pitch_deg: ArrayLike, heading_deg: ArrayLike) -> Array:
    """Rz(heading)·Ry(pitch)·Rx(roll) as matrices (…, 3, 3)."""
    angles = np.radians(np.broadcast_arrays(roll_deg, pitch_deg, heading_deg))
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles), np.sin(angles)
    rows = (
        (cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy),
        (cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy),
        (-sp, sr * cp, cr * cp),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def down_b(roll_deg: ArrayLike, pitch_deg: ArrayLike) -> Array:
    """The direction of down in body axes (…, 3): the last row of `rot_nb` at any heading."""
    roll, pitch = np.radians(np.broadcast_arrays(roll_deg, pitch_deg))
    level = np.cos(pitch)
    return np.stack([-np.sin(pitch), np.sin(roll) * level, np.cos(roll) * level], axis=-1)


def angles_deg(rot_nb: Array) -> tuple[Array, Array, Array]:
    """Roll, pitch and heading (0…360) of matrices (…, 3, 3); roll is 0 with the nose on end."""
    m = np.asarray(rot_nb, dtype=np.float64)
    level = np.hypot(m[..., 0, 0], m[..., 1, 0])
    on_end = level < 1e-9  # roll and heading turn about the same line there
    roll = np.where(on_end, 0.0, np.arctan2(m[..., 2, 1], m[..., 2, 2]))
    pitch = np.arctan2(-m[..., 2, 0], level)
    side = np.arctan2(-m[..., 0, 1], m[..., 1, 1])
    heading = np.where(on_end, side, np.arctan2(m[..., 1, 0], m[..., 0, 0]))
    return np.degrees(roll), np.degrees(pitch), np.degrees(heading) % 360.0


def yaw_pitch_roll(heading_deg: ArrayLike, pitch_deg: ArrayLike, roll_deg: ArrayLike) -> Rotation:
    """`rot_nb` as SciPy rotations, in the order of the turns.

    The product of the three half-angle quaternions, written out: five times the speed of
    `Rotation.from_euler("ZYX", …)`.
    """
    from scipy.spatial.transform import Rotation  # slow to load

    halves = np.radians(np.broadcast_arrays(heading_deg, pitch_deg, roll_deg)) / 2
    (cy, cp, cr), (sy, sp, sr) = np.cos(halves), np.sin(halves)
    x = sr * cp * cy - cr * sp * sy
    y = cr * sp * cy + sr * cp * sy
    z = cr * cp * sy - sr * sp * cy
    w = cr * cp * cy + sr * sp * sy
    return Rotation.from_quat(np.stack([x, y, z, w], axis=-1))


def make_rotation(vector: ArrayLike) -> Array:
    """The matrices (n, 3, 3) that turn about vectors (n, 3) by their lengths, rad."""
    from scipy.spatial.transform import Rotation  # slow to load

    return np.asarray(Rotation.from_rotvec(np.asarray(vector, dtype=float)).as_matrix())


def integrate_rates(rotation_rate: Array, time: Array) -> Rotation:
    """The attitudes (n) that rates (n, 3), rad/s in body axes, turn through, the first one unity.

    Between two rows R₂ = R₁ exp(∫ω dt + Δt²/12 ω₁ × ω₂), the integral over a cubic spline: Magnus
    expansion to fourth order (Blanes, Casas, Oteo & Ros 2009)."""
    from scipy.interpolate import CubicSpline  # slow to load
    from scipy.spatial.transform import Rotation

    turned = np.diff(CubicSpline(time, rotation_rate).antiderivative()(time), axis=0)
    coning = np.cross(rotation_rate[:-1], rotation_rate[1:]) * np.diff(time)[:, None] ** 2 / 12
    steps = Rotation.from_rotvec(np.concatenate([np.zeros((1, 3)), turned + coning]))
    return Rotation.from_quat(_multiply_on(steps.as_quat()))


def _multiply_on(quats: Array) -> Array:
    """The products q₁, q₁q₂, q₁q₂q₃, … of quaternions (n, 4), scalar last.

    All blocks of √n go on together, and then each from the end of the one before.
    """
    n = len(quats)
    width = int(np.ceil(np.sqrt(n)))
    count = -(-n // width)
    blocks = np.tile([0.0, 0.0, 0.0, 1.0], (count * width, 1))
    blocks[:n] = quats
    blocks = blocks.reshape(count, width, 4)
    a, b, c, d = np.moveaxis(blocks, -1, 0)
    rows = [[d, c, -b, a], [-c, d, a, b], [b, -a, d, c], [-a, -b, -c, d]]
    onto = np.moveaxis(np.array(rows), (0, 1), (-2, -1)).copy()  # p q = onto(q) p
    for k in range(1, width):
        np.matmul(onto[:, k], blocks[:, k - 1, :, None], out=blocks[:, k, :, None])
    for k in range(1, count):
        x, y, z, w = blocks[k - 1, -1]
        blocks[k] @= np.array([[w, z, -y, -x], [-z, w, x, -y], [y, -x, w, -z], [x, y, z, w]])
    return blocks.reshape(-1, 4)[:n]
