"""What a magnetometer can do beyond field = matrix @ (raw − bias): errors of a reading by cause.

Every cause is a set of k terms, an error of the raw reading e_i = E_i γ with E_i (3, k), over the
field's radius R in raw units. A residual that measures along the unit normal n_i sees n_i·e_i.
Readings are those without their noise along the normal (the foot on the ellipsoid).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.maths.estimation.noise.autoregression import autoregress
from agonic.maths.one_pass import find_length


class Errors(NamedTuple):
    """What E is made of: `parts` (n, b, 3), or (n, b, 1) where all axes have the same, of which
    every axis has an unknown of its own where they are `apart`, else the whole vector has one."""

    parts: Array
    apart: bool = True

    def show(self, normals: Array) -> Array:
        """What residuals along normals see of each unknown, n·E (j n, k).

        Parameters: normals (j n, 3) of j residuals a row, those of the first kind first.

        >>> Errors(np.array([[[2.0, 3.0, 5.0]]])).show(np.eye(3)[:2]).tolist()
        [[2.0, 0.0, 0.0], [0.0, 3.0, 0.0]]
        """
        along = np.ascontiguousarray(normals.T).reshape(3, -1, len(self.parts))
        seen = along * np.ascontiguousarray(self.parts.transpose(1, 2, 0))[:, :, None]
        columns = seen if self.apart else seen.sum(axis=1)
        return np.asarray(columns.reshape(-1, len(normals)).T)

    def add_up(self, size: Array) -> Array:
        """E γ of unknowns (k,), (n, 3)."""
        by = size.reshape(-1, 3) if self.apart else size[:, None]
        return np.asarray((self.parts * by).sum(axis=1))


Terms = Callable[[Array], Errors]
"""Readings over the radius, (n, 3), to their errors."""

MEMORY_ROWS = 50
TURN_ROWS = 1, 5


def non_linearity(x: Array) -> Errors:
    """Even and odd bending of each axis: x|x| and x³; saturation, missing linearity."""
    return Errors(np.stack([x * np.abs(x), x**3], axis=1))


def gain_by_sign(x: Array) -> Errors:
    """The gain of each axis differs between positive and negative readings: |x|."""
    return Errors(np.abs(x)[:, None])


def common_bend(x: Array) -> Errors:
    """All axes bend alike, as those of one type of sensor and amplifier do: x³, one unknown."""
    return Errors((x**3)[:, None], apart=False)


def compression(x: Array) -> Errors:
    """The whole vector shrinks with its length: x|x|²."""
    return Errors((x * np.sum(x**2, axis=1, keepdims=True))[:, None], apart=False)


def cross_talk(x: Array) -> Errors:
    """Each axis holds something of the products of all axes, x_j x_k: 18 unknowns."""
    products = np.stack([x[:, j] * x[:, k] for j in range(3) for k in range(j, 3)], axis=1)
    return proportional(products)


def ripples(x: Array, frequencies: Array) -> Errors:
    """The error of each axis is a wave along its readings, of these frequencies (3,) per radius."""
    phase = 2 * np.pi * frequencies * x
    return Errors(np.stack([np.cos(phase), np.sin(phase)], axis=1))


def turning(x: Array, apart: Mask) -> Errors:
    """A bias that goes with how fast the field (n, 3) turns in the sensor, over one row and over
    several, by its rms.

    `apart` as for `lag`.
    """
    return proportional(np.stack([_find_rate(x, apart, rows) for rows in TURN_ROWS], axis=1))


def _find_rate(x: Array, apart: Mask, rows: int) -> Array:
    """How far directions move from so many rows before to as many after, over the rms."""
    ahead = x / find_length(x)[:, None]
    rate = np.zeros(len(x))
    rate[rows:-rows] = find_length(ahead[2 * rows :] - ahead[: -2 * rows])
    broken = np.convolve(apart, np.ones(2 * rows + 1), "same") > 0
    rate[broken] = rate[~broken].mean() if not broken.all() else 0.0
    return np.asarray(rate / max(float(np.sqrt(np.mean(rate**2))), 1e-12))


def lag(x: Array, apart: Mask) -> Errors:
    """The reading is late: dx/dt of each axis, by central differences, which hold no own noise.

    `apart` (n,) is true for a row that does not follow the one before it.
    """
    slope = np.zeros_like(x)
    slope[1:-1] = np.where((apart[1:-1] | apart[2:])[:, None], 0.0, (x[2:] - x[:-2]) / 2)
    return Errors(slope[:, None])


def memory(x: Array) -> Errors:
    """The reading holds something of those before it: an average that fades, own reading apart."""
    share = 1.0 / MEMORY_ROWS
    faded = autoregress(share * (x - x[0]), 1.0 - share) + x[0]
    return Errors(np.vstack([x[:1], faded[:-1]])[:, None])


def drift(t: Array, cosines: int) -> Errors:
    """A bias that moves: the first cosines over the recording's time, t (n,) from 0 to 1."""
    return proportional(np.cos(np.pi * np.outer(t, np.arange(1, cosines + 1))))


def gain_drift(x: Array, t: Array) -> Errors:
    """Gains that change over the recording: (2t − 1) x of each axis."""
    return Errors(((2 * t - 1)[:, None] * x)[:, None])


def alternation(rows: Index) -> Errors:
    """Even and odd rows (their numbers, (n,)) differ in bias: two sensors that take turns."""
    return proportional(np.where(rows % 2, 1.0, -1.0)[:, None])


def proportional(signals: Array) -> Errors:
    """A bias along any direction that goes with each of signals (n, k)."""
    return Errors(signals[:, :, None])


def tilt_signals(sine: Array) -> Array:
    """What may go with a bank or a pitch, by its sine (n,): the same and its square, (n, 2)."""
    return np.stack([sine, sine**2], axis=1)
