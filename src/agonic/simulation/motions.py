"""How a simulated sensor turns: each motion gives the attitude rot_nb at given times.

Smooth motions are functions of continuous time, so that their rotation rate is exact at any
sample rate; the others draw every attitude by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.maths.rotations.attitude import yaw_pitch_roll
from agonic.simulation.draws import draw_directions, draw_smooth, make_knots

Attitude = Callable[[Array], Rotation]

_STEP_S = 1e-3  # a central difference over ±1 ms is exact to 1e-6 of the rate of a hand's motion


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """Where the body pointed, and what else was recorded.

    `rot_nb` n attitudes; `rotation_rate` (n, 3) rad/s, body, or `None` where attitudes are
    independent; `acceleration_n` (n, 3) or (3,) kinematic, m/s²; `stray_b` (n, 3) or (3,) field of
    on-board current, nT; `columns` further columns of the samples.
    """

    rot_nb: Rotation
    rotation_rate: Array | None = None
    acceleration_n: Array = field(default_factory=lambda: np.zeros(3))
    stray_b: Array = field(default_factory=lambda: np.zeros(3))
    columns: Mapping[str, Array] = field(default_factory=dict)


def rotation_rate(attitude: Attitude, time: Array) -> Array:
    """Angular velocity (n, 3) in body axes, rad/s: log(R(t − h)ᵀ R(t + h)) / 2h."""
    turned = attitude(time - _STEP_S).inv() * attitude(time + _STEP_S)
    return np.asarray(turned.as_rotvec() / (2 * _STEP_S))


def rate_of_change(function: Callable[[Array], Array], time: Array) -> Array:
    """The derivative of a function of time by central differences."""
    return (function(time + _STEP_S) - function(time - _STEP_S)) / (2 * _STEP_S)


def draw_tumbling(rng: np.random.Generator, duration_s: float, pace_s: float) -> Attitude:
    """Uniform random attitudes every `pace_s`, joined smoothly."""
    knots = make_knots(duration_s, pace_s)
    quats = draw_directions(rng, len(knots), 4)
    turns = np.einsum("ij,ij->i", quats[1:], quats[:-1])
    quats[1:] *= np.cumprod(np.where(turns < 0, -1.0, 1.0))[:, None]
    path = CubicSpline(knots, quats)
    return lambda at: Rotation.from_quat(path(at))


def tumble(time: Array, rng: np.random.Generator, field_n: Array, *, pace_s: float = 1.0) -> Motion:
    """Smooth random rotation, evenly over all attitudes at every moment.

    Uniform random quaternions every `pace_s`, each with the sign that is nearer to the one before,
    joined by a cubic spline and normalised. The construction commutes with rotations, so the
    attitude is uniform (Haar) at all times and the field covers the sphere evenly; its mean rate
    is about 126°/pace_s.
    """
    attitude = draw_tumbling(rng, time[-1], pace_s)
    return Motion(rot_nb=attitude(time), rotation_rate=rotation_rate(attitude, time))


def sphere(time: Array, rng: np.random.Generator, field_n: Array) -> Motion:
    """Independent attitudes, uniform over all rotations."""
    return Motion(rot_nb=Rotation.from_quat(draw_directions(rng, len(time), 4)))


def belt(
    time: Array,
    rng: np.random.Generator,
    field_n: Array,
    *,
    tilt_deg: float = 10.0,
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0),
) -> Motion:
    """Independent attitudes with the field within ±`tilt_deg` of the plane square to `axis`. Field
    directions are uniform by area in that belt (sphere axes), and the turn about the field is
    uniform."""
    longitude, twist = rng.uniform(0, 2 * np.pi, (2, len(time)))
    latitude = np.arcsin(np.sin(np.radians(tilt_deg)) * rng.uniform(-1, 1, len(time)))
    onto_z = _turn_tilt_turn(twist, latitude - np.pi / 2, -longitude)
    return Motion(rot_nb=_from_z_to(field_n) * onto_z * _from_z_to(np.asarray(axis)).inv())


def hand(time: Array, rng: np.random.Generator, field_n: Array) -> Motion:
    """Figure eights of a hand: pitch swings twice for each swing of roll, while one turns round. It
    covers most of the sphere, unevenly: much at the ends of the swings, a little never."""
    period = rng.uniform(5.0, 7.0)
    turn_period = rng.uniform(20.0, 30.0)
    phase = rng.uniform(0, 2 * np.pi, 4)
    wobble = [draw_smooth(rng, time[-1], sd=8.0, pace_s=2.0) for _ in range(3)]

    def attitude(at: Array) -> Rotation:
        swing = 2 * np.pi * at / period + phase[0]
        slow = 2 * np.pi * at / turn_period
        heading = np.degrees(slow + phase[1]) + 40.0 * np.sin(swing) + wobble[0](at)
        pitch = 65.0 * np.sin(2 * swing + 0.3 * np.sin(slow + phase[2])) + wobble[1](at)
        roll = 120.0 * np.sin(swing + 1.5 * slow + phase[3]) + wobble[2](at)
        return yaw_pitch_roll(heading, pitch, roll)

    return Motion(rot_nb=attitude(time), rotation_rate=rotation_rate(attitude, time))


def circle(
    time: Array,
    rng: np.random.Generator,
    field_n: Array,
    *,
    tilt_deg: float = 20.0,
    smooth: bool = True,
    period_s: float = 12.0,
) -> Motion:
    """All headings, tilted by 0…`tilt_deg` towards any side, all three uniformly. Smooth: yaw
    circles of `period_s` under a tilt that swings through level. Otherwise every attitude is drawn
    by itself."""
    if not smooth:
        shares = rng.uniform(size=(3, len(time)))
        yaw, side = 2 * np.pi * shares[:2]
        return Motion(rot_nb=_turn_tilt_turn(yaw + side, np.radians(tilt_deg) * shares[2], -side))
    phase = rng.uniform(0, 2 * np.pi, 3)

    def attitude(at: Array) -> Rotation:
        yaw = 2 * np.pi * at / period_s + phase[0]
        side = yaw * 0.618 + phase[1]
        # a triangle wave with rounded corners: uniform over ±tilt but for the last few percent
        swing = np.arcsin(0.999 * np.sin(yaw * 1.382 + phase[2])) / np.arcsin(0.999)
        return _turn_tilt_turn(yaw + side, np.radians(tilt_deg) * swing, -side)

    return Motion(rot_nb=attitude(time), rotation_rate=rotation_rate(attitude, time))


def static(
    time: Array,
    rng: np.random.Generator,
    field_n: Array,
    *,
    heading_deg: float = 0.0,
    pitch_deg: float = 0.0,
    roll_deg: float = 0.0,
) -> Motion:
    """One attitude throughout."""
    angles = np.broadcast_to([heading_deg, pitch_deg, roll_deg], (len(time), 3))
    return Motion(rot_nb=yaw_pitch_roll(*angles.T), rotation_rate=np.zeros((len(time), 3)))


def _turn_tilt_turn(first: Array, tilt: Array, last: Array) -> Rotation:
    """Rz(first)·Ry(tilt)·Rz(last), radians: the product of the half-angle quaternions."""
    half, both, apart = tilt / 2, (first + last) / 2, (last - first) / 2
    x, y = np.sin(half) * np.sin(apart), np.sin(half) * np.cos(apart)
    z, w = np.cos(half) * np.sin(both), np.cos(half) * np.cos(both)
    return Rotation.from_quat(np.stack([x, y, z, w], axis=-1))


def _from_z_to(vector: Array) -> Rotation:
    """A rotation that takes the z axis onto a vector (3,)."""
    x, y, z = vector
    return _turn_tilt_turn(np.arctan2(y, x), np.arctan2(np.hypot(x, y), z), np.zeros(()))
