"""Tilt compensation: from the field in body axes to the heading, with roll and pitch or with down.

Body axes forward, right, down. Levelling turns the field b = (x, y, z) into axes whose third is
down, and the heading is what turns their first onto magnetic north, clockwise from it:

    heading = atan2(−y₂, x₂)

Two orders of tilting give two sets of level axes. In "roll-pitch" (aerospace, yaw-pitch-roll) the
first level axis lies below or above the forward axis, so the heading is that of the nose. In
"pitch-roll" (inclinometers) the level field is Rx(roll) Ry(pitch) b and the heading is that of the
whole turn Rz(heading) Rx(roll) Ry(pitch); it differs from that of the nose by
atan2(sin roll · sin pitch, cos pitch), which is 0 where one of the angles is.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array

Order = Literal["roll-pitch", "pitch-roll"]


class Tilt(NamedTuple):
    """Sines and cosines of roll and pitch, (…,) each."""

    sin_roll: Array
    cos_roll: Array
    sin_pitch: Array
    cos_pitch: Array


class HeadingDerivatives(NamedTuple):
    """A heading (…,) in degrees, and what it hangs on.

    `horizontal` and `vertical` are the intensities that were measured; `by_field` (3, …) is
    ∂heading/∂field in radians per unit of the field; `by_roll`, `by_pitch` in radians per radian.
    """

    heading_deg: Array
    horizontal: Array
    vertical: Array
    by_field: Array
    by_roll: Array
    by_pitch: Array


def two_axis_deg(x: ArrayLike, y: ArrayLike) -> Array:
    """The heading 0…360 of a level compass with two axes, forward and right: atan2(−y, x).

    The field stands at the angle q = atan2(y, x) from the forward axis, x = k h cos q and
    y = k h sin q; only the ratio counts, so neither gain nor intensity need be known."""
    q = np.arctan2(-np.asarray(y, dtype=np.float64), np.asarray(x, dtype=np.float64))
    return wrap_turn_deg(np.degrees(q))


def wrap_turn_deg(angle_deg: Array) -> Array:
    """Angles of −360…720 brought to 0…360, 360 itself left out."""
    turned = angle_deg + 360.0 * (angle_deg < 0)
    return np.asarray(turned - 360.0 * (turned >= 360.0))


def tilt_from_angles(roll_deg: ArrayLike, pitch_deg: ArrayLike) -> Tilt:
    """The tilt of roll and pitch, degrees."""
    roll, pitch = np.radians(roll_deg), np.radians(pitch_deg)
    return Tilt(*map(np.asarray, (np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch))))


def tilt_from_down(down: Array) -> Tilt:
    """The tilt in which a vector (…, 3) in body axes points down, of any length, without an angle.

    It is that of the order "roll-pitch"; with the nose on end roll is taken to be 0."""
    x, y, z = np.moveaxis(down, -1, 0)
    across = np.sqrt(y * y + z * z)
    size = np.sqrt(across * across + x * x)
    on_end = across <= 1e-12 * size
    divisor = np.where(on_end, 1.0, across)
    cos_roll = np.where(on_end, 1.0, z / divisor)
    return Tilt(np.where(on_end, 0.0, y / divisor), cos_roll, -x / size, across / size)


def compute_down(tilt: Tilt, order: Order = "roll-pitch") -> Array:
    """The direction of down (…, 3) in body axes, the third level axis."""
    sr, cr, sp, cp = tilt
    if order == "roll-pitch":
        return np.stack([-sp, cp * sr, cp * cr], axis=-1)
    return np.stack([-cr * sp, sr, cr * cp], axis=-1)


def down_from_force(specific_force: Array) -> Array:
    """The direction of down (…, 3), from the specific force at rest, which points up."""
    size = np.sqrt((specific_force**2).sum(axis=-1, keepdims=True))
    return np.asarray(-specific_force / np.where(size > 0, size, np.nan))


def roll_pitch_deg(tilt: Tilt) -> tuple[Array, Array]:
    """Roll and pitch, degrees."""
    roll = np.degrees(np.arctan2(tilt.sin_roll, tilt.cos_roll))
    return roll, np.degrees(np.arctan2(tilt.sin_pitch, tilt.cos_pitch))


def _level(field: Array, tilt: Tilt, order: Order) -> tuple[Array, Array, Array, Array]:
    """The level components Ry(pitch) Rx(roll) b, or Rx(roll) Ry(pitch) b, and the third between.

    In the order "pitch-roll", with pitch ρ and roll γ:

        x₂ = x cos ρ + z sin ρ
        y₂ = x sin γ sin ρ + y cos γ − z sin γ cos ρ
        z₂ = −x cos γ sin ρ + y sin γ + z cos γ cos ρ
    """
    x, y, z = np.moveaxis(field, -1, 0)
    sr, cr, sp, cp = tilt
    if order == "roll-pitch":
        between = y * sr + z * cr
        return x * cp + between * sp, y * cr - z * sr, between * cp - x * sp, between
    between = z * cp - x * sp
    return x * cp + z * sp, y * cr - between * sr, y * sr + between * cr, between


def heading_deg(field: Array, tilt: Tilt, order: Order = "roll-pitch") -> Array:
    """The heading 0…360 from magnetic north, of the field (…, 3) in body axes under a tilt."""
    x, y = _level(field, tilt, order)[:2]
    return two_axis_deg(x, y)


def heading_by_vectors_deg(field: Array, down: Array) -> Array:
    """The heading 0…360 of the nose from cross products alone, without roll and pitch.

        east = down × field,   north = east × down,   heading = atan2(east_x, north_x)

    Parameters: field (…, 3) in body axes, down (…, 3) of length one."""
    x, y, z = np.moveaxis(field, -1, 0)
    down_x, down_y, down_z = np.moveaxis(down, -1, 0)
    east_x = down_y * z - down_z * y
    north_x = x - down_x * (down_x * x + down_y * y + down_z * z)
    return two_axis_deg(north_x, -east_x)


def heading_with_derivatives(
    field: Array, tilt: Tilt, order: Order = "roll-pitch"
) -> HeadingDerivatives:
    """The heading of the field (…, 3) under a tilt, and its derivatives.

    With x₂, y₂, z₂ the level field, r₁ and r₂ the first two level axes in body axes and
    h² = x₂² + y₂²: ∂ψ/∂b = (y₂ r₁ − x₂ r₂)/h². Where the body is level, an error of roll turns the
    heading by z₂/h · cos ψ, one of pitch by −z₂/h · sin ψ: the tangent of the dip times the error.
    """
    sr, cr, sp, cp = tilt
    x2, y2, z2, between = _level(field, tilt, order)
    square = x2 * x2 + y2 * y2
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = x2 / square, y2 / square
    if order == "roll-pitch":
        ahead = y * sp
        by_field = np.stack([y * cp, ahead * sr - x * cr, ahead * cr + x * sr])
        by_roll, by_pitch = x * between + y * y2 * sp, y * z2
    else:
        aside = x * sr
        by_field = np.stack([y * cp - aside * sp, -x * cr, y * sp + aside * cp])
        by_roll, by_pitch = x * z2, y * between - x * x2 * sr
    return HeadingDerivatives(
        two_axis_deg(x2, y2), np.sqrt(square), z2, by_field, by_roll, by_pitch
    )
