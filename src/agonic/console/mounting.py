"""`--mounting "x up, y forward"`: where the axes of a sensor point in the vehicle."""

from __future__ import annotations

from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.errors import AgonicError

_WAYS = {
    "forward": (1, 0, 0),
    "backward": (-1, 0, 0),
    "right": (0, 1, 0),
    "left": (0, -1, 0),
    "down": (0, 0, 1),
    "up": (0, 0, -1),
}
"""Along the body's axes: forward, right, down."""


def parse_mounting(text: str) -> Array:
    """The rotation (3, 3) from the sensor's axes to the body's of "x up, y forward".

    Two axes are enough; a third has to agree.

    >>> parse_mounting("x points right, y backward").tolist()
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    """
    along: dict[str, Array] = {}
    for part in text.replace(" points ", " ").split(","):
        match part.lower().split():
            case [("x" | "y" | "z") as axis, way] if way in _WAYS and axis not in along:
                along[axis] = np.array(_WAYS[way], dtype=np.float64)
            case _:
                raise _unclear(text)
    if len(along) < 2:
        raise _unclear(text)
    axes: Any = [along.get(axis) for axis in "xyz"]
    for k in range(3):
        if axes[k] is None:
            axes[k] = np.cross(axes[(k + 1) % 3], axes[(k + 2) % 3])
    turn = np.stack(axes, axis=1)
    if not np.array_equal(turn.T @ turn, np.eye(3)) or np.linalg.det(turn) < 0:
        raise AgonicError(
            f"--mounting {text!r} is no mounting: two axes point the same way, or the three are "
            "left-handed; turn the sensor in thought until each axis points where it says"
        )
    return turn + 0.0


def _unclear(text: str) -> AgonicError:
    return AgonicError(
        f"--mounting {text!r} is not understood; say where two axes of the sensor point in the "
        f'vehicle: "x up, y forward" ({", ".join(_WAYS)})'
    )
