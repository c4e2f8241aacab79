"""Which way a sensor sits in a vehicle, among the turns by right angles."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def right_angles() -> Array:
    """The 24 rotations that take axes to axes, (24, 3, 3); the first is the identity.

    >>> len(right_angles()), right_angles()[0].tolist()
    (24, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    """
    turns = [
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3))
    ]
    return np.array([turn for turn in turns if np.linalg.det(turn) > 0])


def vertical_misfit(readings: Array, down: Array, turns: Array) -> Array:
    """How badly the vertical field is constant for each mounting, (k,), rms over all readings.

    The vertical component of the field is Z = d·R W (raw − bias), so with one gain g

        d·R raw = d·b + Z/g,

    linear in b and Z/g; the misfit is what this leaves. Parameters: readings (n, 3), down (n, 3)
    in body axes, turns (k, 3, 3) from sensor to body axes.
    """
    design = np.column_stack([down, np.ones(len(down))])
    wanted = np.einsum("ni,kij,nj->nk", down, turns, readings - readings.mean(axis=0))
    solution = np.linalg.lstsq(design, wanted, rcond=1e-6)[0]
    return np.asarray(np.sqrt(np.mean((wanted - design @ solution) ** 2, axis=0)))


def in_words(turn: Array) -> str:
    """What the axes of the sensor are in the vehicle.

    >>> in_words(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]))
    'x points right, y backward, z down'
    """
    names = (("backward", "forward"), ("left", "right"), ("up", "down"))
    along = [names[int(np.argmax(np.abs(axis)))][int(axis.sum() > 0)] for axis in turn.T]
    return f"x points {along[0]}, y {along[1]}, z {along[2]}"
