"""Where a sensor sits in a turned box: mounting, field of the room, and stations exchanged.

A station with the rotation R_k (box to chamber) sees the direction R_kᵀ f in the box, and a sensor
mounted by M (its axes to the box's) reads p_k = Mᵀ R_kᵀ f.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.rotations.vectors import find_best_rotation
from agonic.thermal.maths.stations import MOUNTINGS, Exchange, find_exchange

_ROUNDS = 200


class Mounting(NamedTuple):
    """Mounting (3, 3), unit field in the chamber (3,), and the rms angle left, rad."""

    mount: Array
    field: Array
    rms: float


def find_mounting(directions: Array, rot_nb: Array) -> Mounting:
    """The mounting and field that explain the unit directions (k, 3) seen at the stations best.

    M and f in turn, each by least squares (M: Kabsch 1976), from all 24 ways to mount a sensor
    along the axes of the box.
    """
    tried = [_settle(directions, rot_nb, axes) for axes in MOUNTINGS]
    return min(tried, key=lambda found: found.rms)


def _settle(directions: Array, rot_nb: Array, mount: Array) -> Mounting:
    before = np.inf
    field = np.zeros(3)
    for _ in range(_ROUNDS):
        field = np.einsum("kij,jl,kl->i", rot_nb, mount, directions)
        field /= max(float(np.linalg.norm(field)), 1e-12)
        in_box = np.swapaxes(rot_nb, 1, 2) @ field
        mount = find_best_rotation(directions, in_box)
        left = float(np.sum((directions @ mount.T - in_box) ** 2))
        if before - left < 1e-12 * max(left, 1e-12):
            break
        before = left
    return Mounting(mount, field, float(np.sqrt(left / len(directions))))


def find_exchanged_directions(directions: Array, rot_nb: Array) -> Exchange:
    """The two stations whose exchange explains the directions (k, 3) best, the rms in rad.

    The others outvote them, so the mounting found with them as described is a start near enough.
    """
    start = find_mounting(directions, rot_nb).mount
    return find_exchange(rot_nb, lambda order: _settle(directions, order, start).rms)


def find_tangents(unit: Array) -> Array:
    """Two unit vectors square to each other and to unit vectors (…, 3), as columns (…, 3, 2).

    >>> t = find_tangents(np.array([0.0, 0.6, 0.8]))
    >>> bool(np.allclose(t.T @ t, np.eye(2)))
    True
    """
    unit = np.asarray(unit, dtype=np.float64)
    helper = np.eye(3)[np.argmin(np.abs(unit), axis=-1)]
    first = np.cross(unit, helper)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return np.stack([first, np.cross(unit, first)], axis=-1)


def move_on_sphere(unit: Array, tangent: Array, steps: Array) -> tuple[Array, Array]:
    """Unit vectors (…, 3) moved by steps (…, 2) along tangents, and the Jacobian (…, 3, 2)."""
    to = unit + np.einsum("...ij,...j->...i", tangent, steps)
    size = np.linalg.norm(to, axis=-1, keepdims=True)
    to = to / size
    along = np.einsum("...i,...ij->...j", to, tangent)
    return to, (tangent - to[..., :, None] * along[..., None, :]) / size[..., None]
