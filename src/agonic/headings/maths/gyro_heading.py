"""The heading that a gyro carries on, where the tilt is known: ψ₂ − ψ₁ about the vertical.

With L the turn from body to level axes and D the gyro's from one row to the next, R₁ D = R₂ and
R = Rz(ψ) L give Rz(ψ₂ − ψ₁) = L₁ D L₂ᵀ, whatever the attitude; an error δω of the rates turns the
heading by ∫ d·δω dt, d down in body axes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.rotations.attitude import integrate_rates
from agonic.maths.rotations.tilt import Order, Tilt


class GyroHeading(NamedTuple):
    """A heading (n,), rad, from any start; what biases of three axes, rad/s, have added to it by
    then, `by_bias` (n, 3), and what errors of the gain have, `by_gain` (n, 6): three scales, and
    how much of the rates about x and y, x and z, y and z goes into each other."""

    heading: Array
    by_bias: Array
    by_gain: Array


def carry_heading(time: Array, rate: Array, level: Array) -> GyroHeading:
    """The heading by rates (n, 3), rad/s in body axes, between tilts (n, 3, 3), body to level."""
    axes = integrate_rates(rate, time).as_matrix()
    step = np.swapaxes(axes[:-1], 1, 2) @ axes[1:]
    turned = level[:-1] @ step @ np.swapaxes(level[1:], 1, 2)
    sine, cosine = turned[:, 1, 0] - turned[:, 0, 1], turned[:, 0, 0] + turned[:, 1, 1]
    down = level[:, 2]
    x, y, z = down.T
    p, q, r = rate.T
    crossed = np.stack([x * q + y * p, x * r + z * p, y * r + z * q], axis=1)
    return GyroHeading(
        np.concatenate([[0.0], np.cumsum(np.arctan2(sine, cosine))]),
        _integrate(time, down),
        _integrate(time, np.concatenate([down * rate, crossed], axis=1)),
    )


def level_axes(tilt: Tilt, order: Order) -> Array:
    """The turns (n, 3, 3) from body to level axes: Ry(pitch) Rx(roll), or the other way round."""
    sr, cr, sp, cp = tilt
    none = np.zeros_like(sr)
    if order == "roll-pitch":
        rows = ((cp, sp * sr, sp * cr), (none, cr, -sr), (-sp, cp * sr, cp * cr))
    else:
        rows = ((cp, none, sp), (sr * sp, cr, -sr * cp), (-cr * sp, sr, cr * cp))
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _integrate(time: Array, values: Array) -> Array:
    """∫ values dt (n, …) from the first row on."""
    area = (values[1:] + values[:-1]) * np.diff(time)[:, None] / 2
    return np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(area, axis=0)])
