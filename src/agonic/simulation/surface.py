"""On the surface: a boat in waves, and a car in town."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.maths.rotations.attitude import yaw_pitch_roll
from agonic.simulation.draws import draw_smooth
from agonic.simulation.flight import Function, compute_position, draw_course
from agonic.simulation.motions import Motion, rate_of_change, rotation_rate
from agonic.units import STANDARD_GRAVITY_M_S2

_COMPONENTS = 12
_LEAN_DEG_G = (-5.0, 3.0)  # of a car on its springs: roll outwards, nose up, an acceleration of g


def boat(
    time: Array,
    rng: np.random.Generator,
    field_n: Array,
    *,
    speed_m_s: float = 3.0,
    leg_s: float = 40.0,
    wave_s: float = 5.0,
    roll_sd_deg: float = 5.0,
    pitch_sd_deg: float = 2.5,
    surge_sd_m_s2: float = 0.6,
    latitude_deg: float = 54.0,
    longitude_deg: float = 10.0,
) -> Motion:
    """Courses of some `leg_s` joined by turns, under waves of some `wave_s`.

    Rolling, pitching, yawing and the water's own motion are random seas: sums of waves of random
    phase with periods of 0.7 to 1.4 `wave_s`. The water moves in circles, so its acceleration has
    the same standard deviation, `surge_sd_m_s2`, up and down and along either level axis.
    """
    ahead = draw_course(rng, time[-1], leg_s, rate_deg_s=6.0)
    roll, pitch, yaw = (
        _sea(rng, wave_s, sd) for sd in (roll_sd_deg, pitch_sd_deg, pitch_sd_deg / 2)
    )
    drift = [_sea(rng, wave_s, surge_sd_m_s2 * wave_s / (2 * np.pi)) for _ in range(3)]

    def velocity_n(at: Array) -> Array:
        way = np.radians(ahead(at))
        own = speed_m_s * np.stack([np.cos(way), np.sin(way), np.zeros_like(way)], axis=1)
        return own + np.stack([wave(at) for wave in drift], axis=1)

    return _moved(
        time,
        velocity_n,
        lambda at: (ahead(at) + yaw(at), pitch(at), roll(at)),
        (latitude_deg, longitude_deg, 0.0),
    )


def car(
    time: Array,
    rng: np.random.Generator,
    field_n: Array,
    *,
    speed_m_s: float = 9.0,
    leg_s: float = 12.0,
    slope_sd_deg: float = 2.0,
    latitude_deg: float = 52.0,
    longitude_deg: float = 13.0,
) -> Motion:
    """Streets of some `leg_s` joined by flat turns of 20°/s, speeding up, slowing and stopping. The
    road's slope and camber wander by `slope_sd_deg` and the body leans a little on its springs."""
    ahead = draw_course(rng, time[-1], leg_s, rate_deg_s=20.0, turns_deg=(60.0, 120.0))
    pace = draw_smooth(rng, time[-1], sd=0.5 * speed_m_s, pace_s=10.0)
    slope, camber = (draw_smooth(rng, time[-1], sd=slope_sd_deg, pace_s=8.0) for _ in range(2))

    def speed(at: Array) -> Array:
        """Smoothly to a stop where the pace is below zero."""
        return np.asarray(np.logaddexp(0.0, 2.0 * (speed_m_s + pace(at))) / 2.0)

    def velocity_n(at: Array) -> Array:
        way = np.radians(ahead(at))
        climb = np.radians(slope(at))
        parts = [np.cos(climb) * np.cos(way), np.cos(climb) * np.sin(way), -np.sin(climb)]
        return np.asarray(speed(at)[:, None] * np.stack(parts, axis=1))

    def angles_deg(at: Array) -> tuple[Array, Array, Array]:
        turning = np.radians(rate_of_change(ahead, at)) * speed(at) / STANDARD_GRAVITY_M_S2
        ahead_g = rate_of_change(speed, at) / STANDARD_GRAVITY_M_S2
        roll, pitch = _LEAN_DEG_G[0] * turning, _LEAN_DEG_G[1] * ahead_g
        return ahead(at), slope(at) + pitch, camber(at) + roll

    return _moved(time, velocity_n, angles_deg, (latitude_deg, longitude_deg, 0.0))


def _sea(rng: np.random.Generator, wave_s: float, sd: float) -> Function:
    """A sum of waves of equal share and random phase, with periods about `wave_s`."""
    rate = 2 * np.pi / (wave_s * rng.uniform(0.7, 1.4, _COMPONENTS))
    phase = rng.uniform(0.0, 2 * np.pi, _COMPONENTS)
    size = sd * np.sqrt(2 / _COMPONENTS)
    return lambda at: np.asarray(size * np.sin(np.outer(at, rate) + phase).sum(axis=1))


def _moved(
    time: Array,
    velocity_n: Function,
    angles_deg: Callable[[Array], tuple[Array, Array, Array]],
    start: tuple[float, float, float],
) -> Motion:
    """What a velocity and the angles heading, pitch and roll make."""

    def attitude(at: Array) -> Rotation:
        return yaw_pitch_roll(*angles_deg(at))

    return Motion(
        rot_nb=attitude(time),
        rotation_rate=rotation_rate(attitude, time),
        acceleration_n=rate_of_change(velocity_n, time),
        columns=compute_position(time, velocity_n(time), start),
    )
