"""Where a sensor sits in a turned box: mounting, field of the room, and stations exchanged.

A station with the rotation R_k (box to chamber) sees the direction R_kᵀ f in the box, and a sensor
mounted by M (its axes to the box's) reads p_k = Mᵀ R_kᵀ f.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.rotations.vectors import find_best_rotation
from agonic.thermal.maths.stations import MOUNTINGS

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
    return _settle(directions, rot_nb, np.asarray(MOUNTINGS))


def _settle(directions: Array, rot_nb: Array, mounts: Array) -> Mounting:
    """The best of what mountings (s, 3, 3) to start from settle to."""
    mounts, fields = mounts.copy(), np.zeros((len(mounts), 3))
    left, moving = np.full(len(mounts), np.inf), np.arange(len(mounts))
    for _ in range(_ROUNDS):
        field = np.einsum("kij,sjl,kl->si", rot_nb, mounts[moving], directions)
        field /= np.maximum(np.linalg.norm(field, axis=1), 1e-12)[:, None]
        in_box = np.einsum("kij,si->skj", rot_nb, field)
        mount = find_best_rotation(directions, in_box)
        now = np.sum((directions @ np.swapaxes(mount, 1, 2) - in_box) ** 2, axis=(1, 2))
        goes_on = left[moving] - now >= 1e-12 * np.maximum(now, 1e-12)
        mounts[moving], fields[moving], left[moving] = mount, field, now
        moving = moving[goes_on]
        if not len(moving):
            break
    best = int(np.argmin(left))
    return Mounting(mounts[best], fields[best], float(np.sqrt(left[best] / len(directions))))


def find_mistake(directions: Array, rot_nb: Array) -> tuple[tuple[int, ...], float]:
    """The stations whose description explains the directions (k, 3) least, and the rms, rad, left.

    Two that were exchanged, or one that stood elsewhere. The others outvote them, so the mounting
    found with them as described is a start near enough.
    """
    start, places = find_mounting(directions, rot_nb).mount[None], np.arange(len(rot_nb))
    found: dict[tuple[int, ...], float] = {}
    for i, j in combinations(places.tolist(), 2):
        order = places.copy()
        order[[i, j]] = j, i
        found[i, j] = _settle(directions, rot_nb[order], start).rms
    for k in places.tolist():
        found[(k,)] = _settle(directions[places != k], rot_nb[places != k], start).rms
    best = min(found, key=lambda stations: found[stations])
    return best, found[best]


def measure_turns(directions: Array, covariance: Array) -> tuple[Array, Array]:
    """The angles (k,) from the first of unit directions (k, 3) to each, and their standard errors.

    Parameters: the covariance (2k, 2k) of the directions along their tangents.

    >>> angle, sd = measure_turns(np.eye(3)[:2], 1e-4 * np.eye(4))
    >>> np.degrees(angle).round(6).tolist(), sd.round(4).tolist()
    ([0.0, 90.0], [0.0, 0.0141])
    """
    tangents, k = find_tangents(directions), len(directions)
    first = directions[0]
    angle = 2 * np.arcsin(np.minimum(np.linalg.norm(directions - first, axis=1) / 2, 1.0))
    jacobian = np.zeros((k, 2 * k))
    for row in range(1, k):
        sine = max(float(np.sin(angle[row])), 1e-12)
        jacobian[row, 2 * row : 2 * row + 2] = -first @ tangents[row] / sine
        jacobian[row, :2] = -directions[row] @ tangents[0] / sine
    return angle, np.sqrt(np.einsum("ki,ij,kj->k", jacobian, covariance, jacobian))


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
