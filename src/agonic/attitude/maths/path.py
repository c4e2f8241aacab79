"""How a sensor turned, as a function of time: through recorded attitudes, or by a gyro's rates."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.rotations.attitude import integrate_rates
from agonic.maths.rotations.vectors import skew

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

_SKEW = skew(np.eye(3))  # ∂R/∂φ_k for a turn of n by φ: [e_k]× R


class Path(NamedTuple):
    """The entries of rot_nb as a function of time, (9,); of a gyro also ∫R dt (n, 3, 3) at `time`:
    its columns turn n by a bias of each axis."""

    entries: CubicSpline
    time: Array | None = None
    turned: Array | None = None

    def find_drifts(self, at: Array) -> Array:
        """What unit biases of a gyro change of the entries at times (k,), (3, k, 9); none beside
        recorded attitudes. Between rows a drift is a straight line."""
        if self.time is None or self.turned is None:
            return np.zeros((0, len(at), 9))
        columns = self.turned.reshape(-1, 9).T
        turned = np.stack([np.interp(at, self.time, one) for one in columns], axis=1)
        skewed = np.tensordot(turned.reshape(-1, 3, 3), _SKEW, axes=(1, 0))  # (k, j, a, b)
        rot_nb = self.entries(at).reshape(-1, 1, 3, 3)
        return np.asarray((skewed @ rot_nb).swapaxes(0, 1).reshape(3, -1, 9))


def attitude_path(time: Array, rot_nb: Array) -> Path:
    """The path through recorded attitudes (n, 3, 3). They are smoothed by the weights 1, 4, 6, 4,
    1, and their times with them: what noise is left is well below the Nyquist frequency, where a
    spline is as noisy between rows as on them."""
    from scipy.interpolate import CubicSpline  # slow to load

    return Path(CubicSpline(_smooth(time), _smooth(rot_nb.reshape(-1, 9))))


def gyro_path(time: Array, rotation_rate: Array) -> Path:
    """The path that a gyro (n, 3) rad/s integrates to, and what a bias on each axis adds to it."""
    from scipy.interpolate import CubicSpline  # slow to load

    entries = CubicSpline(time, integrate_rates(rotation_rate, time).as_matrix().reshape(-1, 9))
    return Path(entries, time, entries.antiderivative()(time).reshape(-1, 3, 3))


def _smooth(rows: Array) -> Array:
    """Rows averaged with their neighbours by 1, 4, 6, 4, 1; the first and last are kept."""
    for _ in range(2):
        inner = (rows[:-2] + 2 * rows[1:-1] + rows[2:]) / 4
        rows = np.concatenate([rows[:1], inner, rows[-1:]])
    return rows
