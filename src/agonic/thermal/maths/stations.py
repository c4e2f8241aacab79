"""The standard twelve stations of a calibration in a chamber: each face up twice, 90° apart.

Rotations are matrices rot_nb (3, 3) from the axes of the box (front, right side, bottom) to those
of the chamber as seen from its door (back, right, down): field_b = rot_nbᵀ @ field_n.

The magnitude alone determines nine numbers from twelve stations only where the directions of the
field in the box are well spread, and with many choices of the two azimuths that fails: where the
chamber's field lies at 45° to the box, six faces up at the same two azimuths leave a combination
undetermined. Of all ways to go from face to face by quarter turns, this one has the smallest
standard errors at the worst azimuth of the field, and they hardly depend on it.

Where a sensor sits in a turned box: mounting, field of the room, and stations exchanged.

A station with the rotation R_k (box to chamber) sees the direction R_kᵀ f in the box, and a sensor
mounted by M (its axes to the box's) reads p_k = Mᵀ R_kᵀ f.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.maths.rotations.vectors import find_best_rotation

TURNS = {
    "turn": (2, 90.0, "turn it 90° to the right (clockwise seen from above)"),
    "away": (1, -90.0, "tip it 90° away from you: the side that is up goes to the back"),
    "towards": (1, 90.0, "tip it 90° towards you: the side that is up comes to the door"),
    "right": (0, 90.0, "tip it 90° to the right: the side that is up goes to the right"),
    "left": (0, -90.0, "tip it 90° to the left: the side that is up goes to the left"),
}
"""Quarter turns: axis of the chamber (back, right, down), degrees, and words."""

SEQUENCE = (
    "turn",
    "right",
    "turn",
    "right",
    "turn",
    "left",
    "turn",
    "away",
    "turn",
    "away",
    "turn",
)
"""The turns between the standard stations, by name, in the order of least handling."""

FACES = {
    (1, 0, 0): "front",
    (-1, 0, 0): "rear",
    (0, 1, 0): "right side",
    (0, -1, 0): "left side",
    (0, 0, 1): "bottom",
    (0, 0, -1): "top",
}
"""The faces of the box by their direction in its axes."""


MOUNTINGS = Rotation.create_group("O").as_matrix()
"""The 24 ways (24, 3, 3) in which the axes of a sensor can lie along those of the box."""


def list_standard_rotations() -> Array:
    """The standard stations 1…12 as matrices (12, 3, 3) from the box to the chamber."""
    return _list_standard_rotations().copy()


@cache
def _list_standard_rotations() -> Array:
    turned = [np.eye(3)]
    for name in SEQUENCE:
        turned.append(make_quarter_turn(name) @ turned[-1])
    return np.stack(turned)


def make_quarter_turn(name: str) -> Array:
    """The quarter turn of `TURNS` of that name, a matrix (3, 3) in the axes of the chamber."""
    axis, degrees, _ = TURNS[name]
    sine = float(np.sign(degrees))
    turned = np.zeros((3, 3))
    turned[axis, axis] = 1.0
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turned[i, j], turned[j, i] = -sine, sine
    return turned


def describe_pose(rot_nb: Array) -> str:
    """How the box stands, by its faces: which is up, and where one that is not looks."""
    up, back = find_face(rot_nb, (0.0, 0.0, -1.0)), find_face(rot_nb, (1.0, 0.0, 0.0))
    if "front" in (up, back) or "rear" in (up, back):
        return f"{up} up, {back} to the back"
    side = "right" if find_face(rot_nb, (0.0, 1.0, 0.0)) == "front" else "left"
    return f"{up} up, front to the {side}"


def find_face(rot_nb: Array, chamber: tuple[float, float, float]) -> str:
    """The face of the box that looks in a direction of the chamber; "no face" where it is skew."""
    seen = rot_nb.T @ np.array(chamber)
    x, y, z = np.rint(seen).astype(int).tolist()
    return FACES.get((x, y, z), "no face") if np.abs(seen).max() > 0.95 else "no face"


def describe_turn(before: Array, after: Array) -> str:
    """What to do with the box between two stations."""
    change = after @ before.T
    for name, (_, _, words) in TURNS.items():
        if np.abs(change - make_quarter_turn(name)).max() < 1e-6:
            return words
    if np.abs(change - np.eye(3)).max() < 1e-6:
        return "leave it"
    return f"turn it until it stands {describe_pose(after)}"


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
    """Two unit vectors square to each other and to unit vectors (…, 3), as columns (…, 3, 2)."""
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
