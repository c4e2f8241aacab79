"""Many sensors turned by hand at once: as `motions.tumble`, by one matrix for all."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from agonic.arrays import Array
from agonic.simulation.draws import draw_directions, make_knots

_PACE_S = 1.5
_PUSH_PACE_S = 0.7
_PUSH_SD_M_S2 = 0.1  # of a hand that turns slowly


def make_turnings(rng: np.random.Generator, time: Array, count: int) -> tuple[Array, Array]:
    """Level north and down in sensor axes (count, m, 3), for `count` smooth random turnings.

    As `motions.tumble`: uniform random quaternions every 1.5 s joined by a spline, here by one
    matrix for all.
    """
    knots = make_knots(time[-1], _PACE_S)
    quats = draw_directions(rng, count * len(knots), 4).reshape(count, len(knots), 4)
    turns = np.einsum("kij,kij->ki", quats[:, 1:], quats[:, :-1])
    quats[:, 1:] *= np.cumprod(np.where(turns < 0, -1.0, 1.0), axis=1)[..., None]
    path = CubicSpline(knots, np.eye(len(knots)))(time) @ quats
    path /= np.linalg.norm(path, axis=-1, keepdims=True)
    x, y, z, w = np.moveaxis(path, -1, 0)
    north = [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)]
    down = [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]
    return np.stack(north, axis=-1), np.stack(down, axis=-1)


def make_pushes(rng: np.random.Generator, time: Array, count: int) -> Array:
    """Accelerations (count, m, 3) of hands, smooth over a second or so."""
    knots = make_knots(time[-1], _PUSH_PACE_S)
    path = CubicSpline(knots, np.eye(len(knots)))(time)
    return np.asarray(path @ (_PUSH_SD_M_S2 * rng.standard_normal((count, len(knots), 3))))
