"""How a sensor turned, as a function of time: through recorded attitudes, or by a gyro's rates."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.rotations.attitude import integrate_rates

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

# ∂R/∂φ_k for a turn of n by φ: [e_k]× R
_SKEW = np.zeros((3, 3, 3))
_SKEW[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = 1.0
_SKEW[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = -1.0


class Path(NamedTuple):
    """Functions of time (9,): the entries of rot_nb, and what unit drifts of a gyro change them."""

    entries: CubicSpline
    drifts: tuple[CubicSpline, ...] = ()


def attitude_path(time: Array, rot_nb: Array) -> Path:
    """The path through recorded attitudes (n, 3, 3).

    They are smoothed by the weights 1, 4, 6, 4, 1, and their times with them: what noise is left
    is well below the Nyquist frequency, where a spline is as noisy between rows as on them.
    """
    from scipy.interpolate import CubicSpline  # slow to load

    return Path(CubicSpline(_smooth(time), _smooth(rot_nb.reshape(-1, 9))))


def gyro_path(time: Array, rotation_rate: Array) -> Path:
    """The path that a gyro (n, 3) rad/s integrates to, and what a bias on each axis adds to it."""
    from scipy.interpolate import CubicSpline  # slow to load

    rot_nb = integrate_rates(rotation_rate, time).as_matrix()
    turned = CubicSpline(time, rot_nb).antiderivative()(time)  # ∫R dt: columns turn n per bias
    drifts = np.einsum("nkj,kab,nbc->jnac", turned, _SKEW, rot_nb).reshape(3, -1, 9)
    entries = CubicSpline(time, rot_nb.reshape(-1, 9))
    return Path(entries, tuple(CubicSpline(time, drift) for drift in drifts))


def _smooth(rows: Array) -> Array:
    """Rows averaged with their neighbours by 1, 4, 6, 4, 1; the first and last are kept."""
    for _ in range(2):
        inner = (rows[:-2] + 2 * rows[1:-1] + rows[2:]) / 4
        rows = np.concatenate([rows[:1], inner, rows[-1:]])
    return rows
