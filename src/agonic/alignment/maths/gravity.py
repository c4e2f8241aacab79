"""Gravity as a reference: the angle between the field and the vertical is the same everywhere.

At rest an accelerometer reads the vertical. With d the direction of down in its axes, m the field
in the magnetometer's and R from these to those,

    d · R (m − b) = Z

in every orientation, Z the vertical intensity of the place. R changes by small rotation vectors on
the left; b, a bias that the magnetometer still has, may be sought as well.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.noise.student import compute_widening
from agonic.maths.rotations.attitude import make_rotation
from agonic.maths.rotations.mounting import right_angles

_ROUNDS = 30


class GravityEstimate(NamedTuple):
    """R (3, 3), Z, b (3,), the covariance (7, 7) of turn, Z, b, and residuals (k,)."""

    rotation: Array
    vertical: float
    bias: Array
    covariance: Array
    residuals: Array
    freedom: int


def estimate(
    down: Array, field: Array, *, bias: bool = False, gravity: Array | None = None
) -> GravityEstimate:
    """R, Z and perhaps b of k orientations, from whichever of the 24 right angles fits best.

    Parameters: down (k, 3) unit vectors, field (k, 3), the size of gravity (k,) that was read. The
    noise follows from the residuals, and is no less than the sizes of field and gravity scatter by,
    which are the same everywhere too: six orientations leave two residuals, small by chance. The
    covariance is widened by Student's t of the residuals' freedom.
    """
    free = 7 if bias else 4
    size = float(np.linalg.norm(field, axis=1).mean())
    rotation, rest, residuals = _from(right_angles(), down, field / size, free)
    jacobian = _jacobian(rotation, rest, down, field / size)[:, :free]
    freedom = len(down) - free
    variance = float(residuals @ residuals) / freedom if freedom > 0 else np.nan
    variance = max(variance, _scatter_of_sizes(field / size - rest[1:], float(rest[0]), gravity))
    variance *= compute_widening(freedom) ** 2
    units = np.array([1.0] * 3 + [size] * 4)
    covariance = np.zeros((7, 7))
    inner = variance * leastsq.inverse(jacobian.T @ jacobian)
    covariance[:free, :free] = inner * np.outer(units[:free], units[:free])
    return GravityEstimate(
        rotation, float(rest[0] * size), rest[1:] * size, covariance, residuals * size, freedom
    )


def _scatter_of_sizes(field: Array, vertical: float, gravity: Array | None) -> float:
    """Variance that the sizes of field (k, 3) and gravity (k,) show the vertical field to have: by
    its own errors, and by those of the tilt times the horizontal field."""
    sizes = np.linalg.norm(field, axis=1)
    scatter = float(sizes.var(ddof=1))
    if gravity is not None:
        horizontal = max(float(np.mean(sizes**2)) - vertical**2, 0.0)
        scatter += horizontal * float(np.var(gravity / gravity.mean(), ddof=1))
    return scatter


def _from(starts: Array, down: Array, field: Array, free: int) -> tuple[Array, Array, Array]:
    """Gauss–Newton from rotations (s, 3, 3), all at once: the best R, (Z, b) and residuals.

    In units of the field.
    """
    rotation, rest = starts, np.zeros((len(starts), 4))
    rest[:, 0] = _residual(rotation, rest, down, field).mean(axis=-1)
    for _ in range(_ROUNDS):
        residuals = _residual(rotation, rest, down, field)
        jacobian = _jacobian(rotation, rest, down, field)[..., :free]
        step = np.zeros((len(starts), 7))
        step[:, :free] = -(np.linalg.pinv(jacobian, rcond=1e-9) @ residuals[..., None])[..., 0]
        length = np.linalg.norm(step[:, :3], axis=1, keepdims=True)
        step *= np.minimum(1.0, 0.5 / np.maximum(length, 1e-12))  # no further than half a radian
        rotation = make_rotation(step[:, :3]) @ rotation
        rest = rest + step[:, 3:]
        if np.abs(step).max() < 1e-12:
            break
    residuals = _residual(rotation, rest, down, field)
    best = int(np.argmin((residuals**2).sum(axis=-1)))
    return rotation[best], rest[best], residuals[best]


def _seen(rotation: Array, rest: Array, field: Array) -> Array:
    """The field in the axes of the accelerometer, (…, k, 3)."""
    return np.asarray((field - rest[..., None, 1:]) @ np.swapaxes(rotation, -1, -2))


def _residual(rotation: Array, rest: Array, down: Array, field: Array) -> Array:
    return np.asarray((down * _seen(rotation, rest, field)).sum(axis=-1) - rest[..., :1])


def _jacobian(rotation: Array, rest: Array, down: Array, field: Array) -> Array:
    """By the small turn, Z and b, (…, k, 7): d · (δ × v) = δ · (v × d)."""
    across = np.cross(_seen(rotation, rest, field), down)
    return np.concatenate([across, -np.ones_like(across[..., :1]), -down @ rotation], axis=-1)
