"""Rotations between the frames of a robot, as `/tf_static` tells them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array

Edges = Mapping[tuple[str, str], Rotation]
"""Rotations by (parent, child): they turn components in child axes into those of the parent."""


def find_rotation(edges: Edges, into: str, out_of: str) -> Rotation | None:
    """The rotation from components in one frame to those in another; `None` where none leads there.

    >>> turn = Rotation.from_euler("z", 90, degrees=True)
    >>> edges = {("base", "imu"): turn, ("base", "mag"): turn * turn}
    >>> found = find_rotation(edges, "mag", "imu")
    >>> found.as_euler("ZYX", degrees=True).round(6)[0] + 0.0
    np.float64(-90.0)
    """
    steps: dict[str, dict[str, Rotation]] = {}
    for (parent, child), rotation in edges.items():
        steps.setdefault(child, {})[parent] = rotation
        steps.setdefault(parent, {})[child] = rotation.inv()
    reached = {out_of: Rotation.identity()}
    waiting = [out_of]
    while waiting:
        here = waiting.pop()
        for there, rotation in steps.get(here, {}).items():
            if there not in reached:
                reached[there] = rotation * reached[here]
                waiting.append(there)
    return reached.get(into)


def rotate_table(table: Mapping[str, Array], turn: Rotation) -> dict[str, Array]:
    """The columns of an IMU in the axes of another sensor; `turn` is from its axes to those."""
    rotated = dict(table)
    for stem in ("linear_acceleration", "angular_velocity"):
        names = [f"{stem}_{axis}" for axis in "xyz"]
        if set(names) <= set(table):
            values = turn.apply(np.stack([table[name] for name in names], axis=1))
            rotated |= dict(zip(names, values.T, strict=True))
    names = [f"orientation_{axis}" for axis in "xyzw"]
    if set(names) <= set(table):
        quat = np.stack([table[name] for name in names], axis=1)
        known = np.isfinite(quat).all(axis=1)
        turned = np.full_like(quat, np.nan)
        turned[known] = (Rotation.from_quat(quat[known]) * turn.inv()).as_quat()
        rotated |= dict(zip(names, turned.T, strict=True))
    return rotated
