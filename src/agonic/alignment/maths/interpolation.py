"""Attitudes between those that were read: interpolated along the great circle of rotations."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array, Index, Mask

_CURVED = 9.0
"""How many times its own variance a second difference must exceed to be no noise."""
_SAME_MOMENT_S = 1e-6
"""Times that differ by less are one: tables are written to a microsecond."""


class Between(NamedTuple):
    """Attitudes at the moments of `rows`: matrices (k, 3, 3) and covariances (k, 3, 3), rad²."""

    rows: Index
    rotation: Array
    covariance: Array


def interpolate_attitudes(
    moments: Array, time: Array, rotation: Array, covariance: Array, number: Index, gap_s: float
) -> Between:
    """Attitudes at moments (n,) from those read at times (m,), in order.

        R(t) = exp(s θ) R₀,   θ = log(R₁ R₀ᵀ),   s = (t − t₀) / (t₁ − t₀)        (slerp)
        C(t) = (1 − s)² C₀ + s² C₁ + (s(1 − s)/2)² d dᵀ

    d is the second difference of the neighbours where it stands out of their noise: what a platform
    that speeds up does between two readings. A moment at which an attitude was read has that one.
    Other moments outside the times, in a gap of more than `gap_s`, or between readings of different
    `number` (m,) have no attitude and are left out.

    Source: Shoemake, "Animating rotation with quaternion curves", SIGGRAPH 1985.

    >>> quarter = Rotation.from_rotvec([[0, 0, 0], [0, 0, np.pi / 2]]).as_matrix()
    >>> two, none = np.array([0.0, 1.0]), np.zeros((2, 3, 3))
    >>> found = interpolate_attitudes(np.array([0.5, 2.0]), two, quarter, none, np.array([1, 1]), 9)
    >>> found.rows.tolist(), found.rotation[0, 0].round(6).tolist()
    ([0], [0.707107, -0.707107, 0.0])
    """
    after = np.minimum(np.searchsorted(time, moments - _SAME_MOMENT_S), len(time) - 1)
    read = np.abs(time[after] - moments) <= _SAME_MOMENT_S
    joined = (np.diff(time) <= gap_s) & (np.diff(number) == 0)
    between = (moments > time[0]) & (moments < time[-1])
    between[between] = joined[after[between] - 1]
    rows = np.flatnonzero(read | between)
    right = after[rows]
    left = np.where(read[rows], right, right - 1)
    step = np.where(read[rows], 1.0, time[right] - time[left])
    share = np.where(read[rows], 0.0, (moments[rows] - time[left]) / step)[:, None]
    turn = Rotation.from_matrix(rotation[1:] @ np.swapaxes(rotation[:-1], 1, 2)).as_rotvec()
    change = _second_differences(turn, time, covariance, joined)
    turn, change = (np.concatenate([each, np.zeros((1, 3))])[left] for each in (turn, change))
    attitude = Rotation.from_rotvec(share * turn).as_matrix() @ rotation[left]
    s = share[:, :, None]
    spread = (1 - s) ** 2 * covariance[left] + s**2 * covariance[right]
    bend = (s * (1 - s) / 2) * change[:, :, None]
    return Between(rows, attitude, spread + bend @ np.swapaxes(bend, 1, 2))


def _second_differences(turn: Array, time: Array, covariance: Array, joined: Mask) -> Array:
    """By how much the turn of each interval differs from its joined neighbours' (m − 1, 3), rad.

    Differences that the attitudes' own noise explains are zero: for equal steps their variance is
    that of R₀ − 2R₁ + R₂, six times one attitude's.
    """
    step = np.diff(time)[:, None]
    rate = turn / step
    change = np.zeros_like(turn)
    difference = np.abs(np.diff(rate, axis=0)) * (step[:-1] + step[1:]) / 2
    difference *= (joined[:-1] & joined[1:])[:, None]
    change[1:] = difference
    change[:-1] = np.maximum(change[:-1], difference)
    noise = 6 * np.diagonal(covariance, axis1=1, axis2=2)
    return np.where(change**2 > _CURVED * np.maximum(noise[:-1], noise[1:]), change, 0.0)
