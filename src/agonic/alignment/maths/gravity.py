"""Gravity as a reference: the angle between the field and the vertical is the same everywhere.

At rest an accelerometer reads the vertical. With d the direction of down in its axes, m the field
in the magnetometer's and R from these to those,

    d · R (m − b) = Z

in every orientation, Z the vertical intensity of the place. R changes by small rotation vectors on
the left; b, a bias that the magnetometer still has, may be sought as well.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from agonic.arrays import Array, Mask
from agonic.maths.estimation import leastsq
from agonic.maths.estimation.student import compute_widening
from agonic.maths.rotations.mounting import right_angles

WINDOW_S, LEAST_S, TRIM_S = 0.5, 1.0, 0.2
STILL = 3.0
"""Scatter, in units of that of the stillest part, up to which a sensor stands still."""
_STILLEST = 0.05
_ROUNDS = 30


class GravityEstimate(NamedTuple):
    """R (3, 3), Z, b (3,), the covariance (7, 7) of turn, Z, b, and residuals (k,)."""

    rotation: Array
    vertical: float
    bias: Array
    covariance: Array
    residuals: Array
    freedom: int


def find_rest(time: Array, *columns: Array) -> NDArray[np.int64]:
    """The number of the static stretch that each row belongs to, (n,); −1 for none.

    In a running window of half a second no column (n, 3) may scatter more than three times as much
    as in its stillest twentieth. A stretch lasts at least a second; its ends are left out.
    """
    n = len(time)
    rate = (n - 1) / max(float(time[-1] - time[0]), 1e-9)
    width = int(np.clip(round(WINDOW_S * rate), 3, max(n, 3)))
    if n < 2 * width:
        return np.full(n, -1)
    rest = np.ones(n, dtype=bool)
    for column in columns:
        scatter = _running_sd(column, width)
        least = max(float(np.quantile(scatter, _STILLEST)), 1e-6 * float(np.abs(column).max()))
        rest &= scatter <= STILL * least
    return _numbered(rest, time)


def _running_sd(values: Array, width: int) -> Array:
    """Standard deviation (n,), all axes together, in a window about each row."""
    centred = values - values.mean(axis=0)
    sums = np.cumsum(np.vstack([np.zeros((1, 3)), centred]), axis=0)
    squares = np.cumsum(np.concatenate([[0.0], (centred**2).sum(axis=1)]))
    first = np.clip(np.arange(len(values)) - width // 2, 0, len(values) - width)
    mean = (sums[first + width] - sums[first]) / width
    variance = (squares[first + width] - squares[first]) / width - (mean**2).sum(axis=1)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))


def _numbered(rest: Mask, time: Array) -> NDArray[np.int64]:
    """Runs of rest by number, the short ones and the ends of the others left out."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], rest.astype(np.int8), [0]])))
    number = np.full(len(rest), -1)
    count = 0
    for begin, end in edges.reshape(-1, 2):
        if time[end - 1] - time[begin] < LEAST_S:
            continue
        own = np.arange(begin, end)
        inside = (time[own] - time[begin] >= TRIM_S) & (time[end - 1] - time[own] >= TRIM_S)
        number[own[inside]] = count
        count += 1
    return number


def estimate(down: Array, field: Array, *, bias: bool = False) -> GravityEstimate:
    """R, Z and perhaps b of k orientations, from whichever of the 24 right angles fits best.

    Parameters: down (k, 3) unit vectors, field (k, 3). The noise follows from the residuals, and
    the covariance is widened by Student's t of their freedom.
    """
    free = 7 if bias else 4
    size = float(np.linalg.norm(field, axis=1).mean())
    best = min(
        (_from(start, down, field / size, free) for start in right_angles()),
        key=lambda found: float(found[2] @ found[2]),
    )
    rotation, rest, residuals = best
    jacobian = _jacobian(rotation, rest, down, field / size)[:, :free]
    freedom = len(down) - free
    variance = float(residuals @ residuals) / freedom if freedom > 0 else np.nan
    variance *= compute_widening(freedom) ** 2
    units = np.array([1.0] * 3 + [size] * 4)
    covariance = np.zeros((7, 7))
    inner = variance * leastsq.inverse(jacobian.T @ jacobian)
    covariance[:free, :free] = inner * np.outer(units[:free], units[:free])
    return GravityEstimate(
        rotation, float(rest[0] * size), rest[1:] * size, covariance, residuals * size, freedom
    )


def _from(start: Array, down: Array, field: Array, free: int) -> tuple[Array, Array, Array]:
    """Gauss–Newton from a rotation: R, (Z, b) and residuals, in units of the field."""
    rotation, rest = start, np.zeros(4)
    rest[0] = float(np.einsum("ki,ij,kj->k", down, rotation, field).mean())
    for _ in range(_ROUNDS):
        residuals = _residual(rotation, rest, down, field)
        jacobian = _jacobian(rotation, rest, down, field)[:, :free]
        step = np.zeros(7)
        step[:free] = -np.linalg.lstsq(jacobian, residuals, rcond=1e-9)[0]
        length = float(np.linalg.norm(step[:3]))
        step *= min(1.0, 0.5 / max(length, 1e-12))  # a turn no larger than half a radian at once
        rotation = Rotation.from_rotvec(step[:3]).as_matrix() @ rotation
        rest = rest + step[3:]
        if np.abs(step).max() < 1e-12:
            break
    return rotation, rest, _residual(rotation, rest, down, field)


def _residual(rotation: Array, rest: Array, down: Array, field: Array) -> Array:
    return np.asarray((down * ((field - rest[1:]) @ rotation.T)).sum(axis=1) - rest[0])


def _jacobian(rotation: Array, rest: Array, down: Array, field: Array) -> Array:
    """By the small turn, Z and b, (k, 7): d · (δ × v) = δ · (v × d)."""
    seen = (field - rest[1:]) @ rotation.T
    return np.hstack([np.cross(seen, down), -np.ones((len(down), 1)), -down @ rotation])
