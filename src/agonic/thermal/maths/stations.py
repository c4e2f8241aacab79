"""The standard twelve stations of a calibration in a chamber: each face up twice, 90° apart.

Rotations are matrices rot_nb (3, 3) from the axes of the box (front, right side, bottom) to those
of the chamber as seen from its door (back, right, down): field_b = rot_nbᵀ @ field_n.

The magnitude alone determines nine numbers from twelve stations only where the directions of the
field in the box are well spread, and with many choices of the two azimuths that fails: where the
chamber's field lies at 45° to the box, six faces up at the same two azimuths leave a combination
undetermined. Of all ways to go from face to face by quarter turns, this one has the smallest
standard errors at the worst azimuth of the field, and they hardly depend on it.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array

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
    """The standard stations 1…12 as matrices (12, 3, 3) from the box to the chamber.

    >>> turned = list_standard_rotations()
    >>> up = turned[:, 2] * -1  # which direction of the box is up
    >>> sorted(tuple(row) for row in up.astype(int).tolist())[::2] == sorted(FACES)
    True
    """
    return _list_standard_rotations().copy()


@cache
def _list_standard_rotations() -> Array:
    turned = [np.eye(3)]
    for name in SEQUENCE:
        turned.append(make_quarter_turn(name) @ turned[-1])
    return np.stack(turned)


def make_quarter_turn(name: str) -> Array:
    """The quarter turn of `TURNS` of that name, a matrix (3, 3) in the axes of the chamber.

    >>> make_quarter_turn("turn").tolist()
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    axis, degrees, _ = TURNS[name]
    sine = float(np.sign(degrees))
    turned = np.zeros((3, 3))
    turned[axis, axis] = 1.0
    i, j = (axis + 1) % 3, (axis + 2) % 3
    turned[i, j], turned[j, i] = -sine, sine
    return turned


def describe_pose(rot_nb: Array) -> str:
    """How the box stands, by its faces: which is up, and where one that is not looks.

    >>> [describe_pose(rot_nb) for rot_nb in list_standard_rotations()[:3]]
    ['top up, front to the back', 'top up, front to the right', 'rear up, left side to the back']
    """
    up, back = find_face(rot_nb, (0.0, 0.0, -1.0)), find_face(rot_nb, (1.0, 0.0, 0.0))
    if "front" in (up, back) or "rear" in (up, back):
        return f"{up} up, {back} to the back"
    side = "right" if find_face(rot_nb, (0.0, 1.0, 0.0)) == "front" else "left"
    return f"{up} up, front to the {side}"


def find_face(rot_nb: Array, chamber: tuple[float, float, float]) -> str:
    """The face of the box that looks in a direction of the chamber; "no face" where it is skew.

    >>> find_face(np.eye(3), (0.0, 0.0, -1.0))
    'top'
    """
    seen = rot_nb.T @ np.array(chamber)
    x, y, z = np.rint(seen).astype(int).tolist()
    return FACES.get((x, y, z), "no face") if np.abs(seen).max() > 0.95 else "no face"


def describe_turn(before: Array, after: Array) -> str:
    """What to do with the box between two stations.

    >>> one, two, three = list_standard_rotations()[:3]
    >>> describe_turn(one, two)
    'turn it 90° to the right (clockwise seen from above)'
    >>> describe_turn(three, one)
    'turn it until it stands top up, front to the back'
    """
    change = after @ before.T
    for name, (_, _, words) in TURNS.items():
        if np.abs(change - make_quarter_turn(name)).max() < 1e-6:
            return words
    if np.abs(change - np.eye(3)).max() < 1e-6:
        return "leave it"
    return f"turn it until it stands {describe_pose(after)}"
