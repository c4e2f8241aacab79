"""What attitudes at rest tell of an accelerometer and a magnetometer: residuals and their noise.

With u = A (a − b_a) up, v = M (m − b_m) the field, both of length one, and s the sight:

    |u| = 1,   |v| = 1,   asin(−û·v̂) = I,
    asin(û·s) = e_k,   atan2(v·(û×s), v·(s − (û·s) û)) = α_k   while the sight is on target k.

No attitude is needed. Unknowns, in this order: b_a (3), A (xx yy zz xy xz yz), b_m (3), M (9, row
by row), I, s (3), and e and α of every target.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.maths.equation.symmetric import pack_symmetric, unpack_symmetric

BIAS_A, SHAPE_A = slice(0, 3), slice(3, 9)
BIAS_M, MATRIX_M = slice(9, 12), slice(12, 21)
DIP, SIGHT, TARGETS = 21, slice(22, 25), 25
LEVEL_LEAST = 0.02
"""Of the level part of a unit vector, so that nothing divides by zero at the poles."""


class Shots(NamedTuple):
    """Normalised readings (n, 3) of n attitudes at rest, and the number of the target of each.
    `target` is −1 where the sight was on none."""

    force: Array
    field: Array
    target: Index

    @property
    def targets(self) -> int:
        """How many targets were sighted."""
        return int(self.target.max(initial=-1)) + 1

    def select(self, rows: Index) -> Shots:
        """Some of the shots."""
        return Shots(self.force[rows], self.field[rows], self.target[rows])


class Channels(NamedTuple):
    """The five numbers of each shot (n, 5), and their derivatives by u, v and s, (n, 5, 3)."""

    values: Array
    by_up: Array
    by_field: Array
    by_sight: Array


def split(unknowns: Array) -> tuple[Array, Array, Array, Array]:
    """b_a, A, b_m and M."""
    shape = unpack_symmetric(unknowns[SHAPE_A])
    return unknowns[BIAS_A], shape, unknowns[BIAS_M], unknowns[MATRIX_M].reshape(3, 3)


def observe(up: Array, field: Array, sight: Array) -> Channels:
    """Size of up, size of the field, dip, elevation and azimuth of the sight, rad."""
    size_u, size_v = (np.linalg.norm(w, axis=1, keepdims=True) for w in (up, field))
    size_s = float(np.linalg.norm(sight))
    u, v, s = up / size_u, field / size_v, sight / size_s
    cosine, height = (u * v).sum(axis=1, keepdims=True), (u @ s)[:, None]
    level_v = np.sqrt(np.maximum(1 - cosine**2, LEVEL_LEAST**2))
    level_s = np.sqrt(np.maximum(1 - height**2, LEVEL_LEAST**2))
    across = np.cross(u, s)  # to its left, as long as its level part
    ahead = s - height * u
    aside, north = (v * across).sum(axis=1, keepdims=True), (v * ahead).sum(axis=1, keepdims=True)
    square = np.maximum(aside**2 + north**2, LEVEL_LEAST**4)
    turned_u = (north * np.cross(s, v) + aside * (v * height + s * cosine)) / square
    values = np.hstack(
        [
            size_u,
            size_v,
            np.arcsin(np.clip(-cosine, -1, 1)),
            np.arcsin(np.clip(height, -1, 1)),
            np.arctan2(aside, north),
        ]
    )
    zero = np.zeros_like(u)
    by_up = [
        u,
        zero,
        -(v - cosine * u) / level_v / size_u,
        (s - height * u) / level_s / size_u,
        (turned_u - (turned_u * u).sum(axis=1, keepdims=True) * u) / size_u,
    ]
    by_field = [
        zero,
        v,
        -(u - cosine * v) / level_v / size_v,
        zero,
        (north * across - aside * ahead) / square / size_v,
    ]
    by_sight = [
        zero,
        zero,
        zero,
        (u - height * s) / level_s / size_s,
        (north * np.cross(v, u) - aside * (v - cosine * u)) / square / size_s,
    ]
    derivatives = (np.stack(parts, axis=1) for parts in (by_up, by_field, by_sight))
    return Channels(values, *derivatives)


def differentiate(
    channels: Channels, unknowns: Array, up: Array, field: Array, targets: int = 0
) -> Array:
    """∂(five numbers)/∂(unknowns), (n, 5, q), at up and field of length near one."""
    _, shape, _, matrix = split(unknowns)
    jacobian = np.zeros((len(up), 5, TARGETS + 2 * targets))
    jacobian[:, :, BIAS_A] = -channels.by_up @ shape
    force = up @ np.linalg.inv(shape).T  # a − b_a
    outer = channels.by_up[:, :, :, None] * force[:, None, None, :]
    jacobian[:, :, SHAPE_A] = pack_symmetric(outer + np.swapaxes(outer, -1, -2))
    jacobian[:, :, 3:6] /= 2.0
    jacobian[:, :, BIAS_M] = -channels.by_field @ matrix
    reading = field @ np.linalg.inv(matrix).T
    outer = channels.by_field[:, :, :, None] * reading[:, None, None, :]
    jacobian[:, :, MATRIX_M] = outer.reshape(len(up), 5, 9)
    jacobian[:, :, SIGHT] = channels.by_sight
    return jacobian


def calibrate(shots: Shots, unknowns: Array) -> tuple[Array, Array]:
    """Up and field (n, 3) of the shots, of length near one."""
    bias_a, shape, bias_m, matrix = split(unknowns)
    return (shots.force - bias_a) @ shape.T, (shots.field - bias_m) @ matrix.T


class Residuals(NamedTuple):
    """Residuals (n, 5), their Jacobian (n, 5, q), unit variances (3, n, 5, 5), and what is there.
    The three kinds of noise: of the accelerometer, of the magnetometer, and of pointing."""

    residuals: Array
    jacobian: Array
    variances: Array
    there: Mask


def linearise(shots: Shots, unknowns: Array) -> Residuals:
    """Residuals, Jacobian and noise of the shots at some unknowns. An azimuth counts with the
    cosine of the target's elevation, so that pointing errs alike in all directions."""
    up, field = calibrate(shots, unknowns)
    channels = observe(up, field, unknowns[SIGHT])
    _, shape, _, matrix = split(unknowns)
    jacobian = differentiate(channels, unknowns, up, field, shots.targets)
    rows = np.flatnonzero(shots.target >= 0)
    at = TARGETS + 2 * shots.target[rows]
    expected = np.ones((len(up), 5))
    expected[:, 2], expected[rows, 3], expected[rows, 4] = (
        unknowns[DIP],
        unknowns[at],
        unknowns[at + 1],
    )
    residuals = channels.values - expected
    residuals[:, 4] = np.angle(np.exp(1j * residuals[:, 4]))
    jacobian[:, 2, DIP] = -1.0
    jacobian[rows, 3, at] = jacobian[rows, 4, at + 1] = -1.0
    there = np.ones((len(up), 5), dtype=bool)
    there[:, 3:] = (shots.target >= 0)[:, None]
    weight = there.astype(np.float64)
    weight[rows, 4] = np.cos(unknowns[at])
    by_noise = (channels.by_up @ shape, channels.by_field @ matrix)
    weighted = [weight[:, :, None] * by for by in by_noise]
    pointing = np.zeros((len(up), 5, 5))
    pointing[rows, 3, 3] = pointing[rows, 4, 4] = 1.0
    variances = np.stack([by @ np.swapaxes(by, 1, 2) for by in weighted] + [pointing])
    return Residuals(weight * residuals, weight[:, :, None] * jacobian, variances, there)
