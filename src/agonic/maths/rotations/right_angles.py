"""Which way a sensor sits in a vehicle, among the turns by right angles."""

from __future__ import annotations

from functools import cache
from itertools import permutations, product

import numpy as np

from agonic.arrays import Array


@cache
def right_angles() -> Array:
    """The 24 rotations that take axes to axes, (24, 3, 3); the first is the identity."""
    turns = [
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3))
    ]
    proper = np.array([turn for turn in turns if np.linalg.det(turn) > 0])
    proper.flags.writeable = False
    return proper


def vertical_misfit(
    readings: Array,
    down: Array,
    turns: Array,
    weights: Array | None = None,
    *,
    vertical: Array | None = None,
    centred: bool = False,
    talk: float = 0.0,
) -> Array:
    """How badly the vertical field is that of the place for each mounting, (k,), rms over all
    readings.

    The vertical component of the field is Z = d·R W (raw − bias), so with one gain g

        d·R raw = d·b + Z/g,

    linear in b and 1/g; the misfit is what this leaves. It is a quadratic form of R in the products
    d_i raw_j, so their moments are taken once for all mountings. R and −R leave the same: the sign
    of 1/g is free.

    Parameters: readings (n, 3), down (n, 3) in body axes, turns (k, 3, 3) from sensor to body axes,
    weights (n,) of the readings; `vertical` field Z (n,) where it changes along the way, else it is
    constant; `centred` where they are calibrated, so that b is 0. With `talk`, which belongs to
    readings of unit size, W may differ from g: the misfit is the least of
    (misfit² with R + A) + talk² |A|², where |A| is the root of the sum of squares.
    """
    n = len(readings)
    weights = np.ones(n) if weights is None else weights
    seen = readings if centred else readings - readings.mean(axis=0)
    products = (down[:, :, None] * seen[:, None, :]).reshape(n, 9)
    columns = [products, np.ones(n)] if centred else [products, down, np.ones(n)]
    if vertical is not None and len(vertical) > 1:
        columns.append(vertical)
    table = np.column_stack(columns)
    gram = (table * weights[:, None]).T @ table / weights.sum()
    among, across, known = gram[:9, :9], gram[:9, 9:], gram[9:, 9:]
    left = among - across @ np.linalg.pinv(known, rcond=1e-12, hermitian=True) @ across.T
    if talk:  # the minimum over A, in closed form
        left = talk**2 * np.linalg.solve(left + talk**2 * np.eye(9), left)
    forms = turns.reshape(-1, 9)
    squares = np.einsum("ki,ij,kj->k", forms, left, forms)
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))


def describe_mounting(turn: Array) -> str:
    """What the axes of the sensor are in the vehicle."""
    names = (("backward", "forward"), ("left", "right"), ("up", "down"))
    along = [names[int(np.argmax(np.abs(axis)))][int(axis.sum() > 0)] for axis in turn.T]
    return f"x points {along[0]}, y {along[1]}, z {along[2]}"


def describe_turn(turn: Array) -> str:
    """How a sensor sits, by words where its axes lie along those of the vehicle, else by angles."""
    from scipy.spatial.transform import Rotation  # here, so that what only reads loads no SciPy

    if np.abs(turn - np.rint(turn)).max() < 1e-9:
        return f"mounted so that {describe_mounting(turn)}"
    angles = Rotation.from_matrix(turn).as_euler("ZYX", degrees=True)
    yaw, pitch, roll = np.round(angles, 1) + 0.0
    words = f"roll {roll:.1f}°, pitch {pitch:.1f}°, yaw {yaw:.1f}°"
    return f"turned in the vehicle ({words.replace('-', '−')})"


def describe_renaming(turn: Array) -> str:
    """What is wrong with the names of axes that a turn, proper or not, puts right."""
    along = np.argmax(np.abs(turn), axis=0)
    reversed_ = [int(i) for i in np.flatnonzero(turn.sum(axis=0) < 0)]
    moved = [int(i) for i in np.flatnonzero(along != np.arange(3))]
    if not moved and reversed_:
        return f"{_list_axes(reversed_)} {'is' if len(reversed_) == 1 else 'are'} reversed"
    if len(moved) == 2 and not reversed_:
        return f"{_list_axes(moved)} are exchanged"
    signs = ("−" if i in reversed_ else "" for i in range(3))
    truly = ", ".join(sign + "xyz"[i] for sign, i in zip(signs, along, strict=True))
    return f"what is called x, y, z lies along {truly}"


def _list_axes(axes: list[int]) -> str:
    """Axes by name: "x", "x and y", "x, y and z"."""
    *first, last = ("xyz"[i] for i in axes)
    return f"{', '.join(first)} and {last}" if first else last
