"""Flights: legs and banked turns, with the current that climbing and turning draws."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.errors import AgonicError
from agonic.maths.rotations.attitude import yaw_pitch_roll
from agonic.simulation.draws import draw_smooth
from agonic.simulation.motions import (
    Attitude,
    Motion,
    rate_of_change,
    rotation_rate,
)
from agonic.units import STANDARD_GRAVITY_M_S2

Function = Callable[[Array], Array]
Vehicle = Literal["plane", "copter"]

EARTH_RADIUS_M = 6_371_008.8  # IUGG mean radius; a sphere is enough for the columns of a flight

_SPEED_AND_LEAN = {"plane": (18.0, 3.0), "copter": (8.0, -12.0)}  # m/s, degrees nose up


class Flown(NamedTuple):
    """A flight as functions of time: attitude, velocity in n (m/s), throttle 0…1."""

    attitude: Attitude
    velocity_n: Function
    throttle: Function


def flight(
    time: Array,
    rng: np.random.Generator,
    field_n: Array,
    *,
    vehicle: Vehicle = "plane",
    leg_s: float = 12.0,
    turns_deg: tuple[float, float] = (60.0, 210.0),
    stray_nT_A: tuple[float, float, float] = (60.0, -35.0, 90.0),
    full_current_A: float = 25.0,
    latitude_deg: float = 47.0,
    longitude_deg: float = 8.0,
    altitude_m: float = 500.0,
) -> Motion:
    """Legs of `leg_s` joined by coordinated turns to either side, in gentle climbs and descents.

    A turn goes on for `turns_deg`, from and to; more than 360° are orbits. The bank of a turn is
    tan φ = V·χ̇/g. Climbing and turning cost throttle, throttle costs current, and the current adds
    the field `stray_nT_A`·I in sensor axes.
    """
    flown = fly(rng, time[-1], vehicle=vehicle, leg_s=leg_s, turns_deg=turns_deg)
    current = compute_current_A(flown.throttle(time), full_current_A)
    place = compute_position(
        time, flown.velocity_n(time), (latitude_deg, longitude_deg, altitude_m)
    )
    return Motion(
        rot_nb=flown.attitude(time),
        rotation_rate=rotation_rate(flown.attitude, time),
        acceleration_n=rate_of_change(flown.velocity_n, time),
        stray_b=np.outer(current, stray_nT_A),
        columns={"current_A": current, "throttle": flown.throttle(time), **place},
    )


def fly(
    rng: np.random.Generator,
    duration_s: float,
    *,
    vehicle: Vehicle = "plane",
    leg_s: float = 12.0,
    turns_deg: tuple[float, float] = (60.0, 210.0),
    bank_deg: float | None = None,
) -> Flown:
    """A flight of legs and coordinated turns of `turns_deg`, from and to. `bank_deg` is the
    steepest bank of the turns. Without a bank the turns are flown at 15°/s."""
    if vehicle not in _SPEED_AND_LEAN:
        raise AgonicError(f"no vehicle {vehicle!r}; choose from {', '.join(_SPEED_AND_LEAN)}")
    speed, lean_deg = _SPEED_AND_LEAN[vehicle]
    rate_deg_s = 15.0 if bank_deg is None else _turn_rate(bank_deg, speed)
    course_deg = draw_course(rng, duration_s, leg_s, rate_deg_s, turns_deg)
    climb_deg = draw_smooth(rng, duration_s, sd=3.0, pace_s=15.0)
    gusts = [draw_smooth(rng, duration_s, sd=sd, pace_s=0.7) for sd in (1.0, 1.5, 2.0)]
    surge = draw_smooth(rng, duration_s, sd=0.05, pace_s=3.0)

    def banked_deg(at: Array) -> Array:
        turn = np.radians(rate_of_change(course_deg, at))
        return np.degrees(np.arctan(speed * turn / STANDARD_GRAVITY_M_S2))

    def attitude(at: Array) -> Rotation:
        return yaw_pitch_roll(
            course_deg(at) + gusts[0](at),
            climb_deg(at) + lean_deg + gusts[1](at),
            banked_deg(at) + gusts[2](at),
        )

    def velocity_n(at: Array) -> Array:
        climb, course = np.radians(climb_deg(at)), np.radians(course_deg(at))
        north, east = np.cos(climb) * np.cos(course), np.cos(climb) * np.sin(course)
        return speed * np.stack([north, east, -np.sin(climb)], axis=1)

    def throttle(at: Array) -> Array:
        """What climbing, the load factor 1/cos φ and gusts ask for, 0.05…1."""
        load = 1 / np.cos(np.radians(banked_deg(at))) - 1
        return np.clip(0.45 + 0.05 * climb_deg(at) + 0.4 * load + surge(at), 0.05, 1.0)

    return Flown(attitude, velocity_n, throttle)


def compute_current_A(throttle: Array, full_current_A: float) -> Array:
    """The current that a throttle draws: P ∝ thrust^1.5 (momentum theory), and a little always."""
    return np.asarray(full_current_A * (0.05 + 0.95 * throttle**1.5))


def steer(rng: np.random.Generator, duration_s: float, throttle: Function, motors: int) -> Function:
    """The duty of each motor, (n, k) at times (n,): the throttle, and what steers the vehicle."""
    own = [draw_smooth(rng, duration_s, sd=0.08, pace_s=0.7) for _ in range(motors)]

    def duty(at: Array) -> Array:
        steered = [motor(at) for motor in own]
        return np.stack([np.clip(throttle(at) + one, 0.05, 1.0) for one in steered], axis=1)

    return duty


def _turn_rate(bank_deg: float, speed: float) -> float:
    """Mean °/s of a turn whose steepest bank is given: the quintic step's peak rate is 15/8."""
    if not 0 < bank_deg < 80:
        raise AgonicError(f"bank_deg is {bank_deg}; a coordinated turn needs 0 to 80°")
    return float(
        np.degrees(STANDARD_GRAVITY_M_S2 * np.tan(np.radians(bank_deg)) / speed) / (15 / 8)
    )


def draw_course(
    rng: np.random.Generator,
    duration_s: float,
    leg_s: float,
    rate_deg_s: float,
    turns_deg: tuple[float, float] = (60.0, 210.0),
) -> Function:
    """The course in degrees: constant on legs, turning smoothly between them. Turns of so many
    degrees, to either side, at `rate_deg_s` on average."""
    n = int(np.ceil(duration_s / leg_s)) + 1
    turns = rng.uniform(*turns_deg, n) * rng.choice([-1.0, 1.0], n)
    lasting = np.abs(turns) / rate_deg_s
    starts = leg_s + np.concatenate([[0.0], np.cumsum(lasting + leg_s)[:-1]])
    headings = rng.uniform(0, 360) + np.concatenate([[0.0], np.cumsum(turns)[:-1]])

    def course_deg(at: Array) -> Array:
        k = np.maximum(np.searchsorted(starts, at) - 1, 0)
        u = np.clip((at - starts[k]) / lasting[k], 0.0, 1.0)
        # the quintic step has zero first and second derivatives at both ends: no jump in bank rate
        return np.asarray(headings[k] + turns[k] * u**3 * (10 + u * (6 * u - 15)))

    return course_deg


def compute_position(
    time: Array, velocity_n: Array, start: tuple[float, float, float]
) -> dict[str, Array]:
    """Latitude, longitude and altitude along a velocity (n, 3) in north, east, down."""
    north, east, down = cumulative_trapezoid(velocity_n, time, axis=0, initial=0).T
    parallel = EARTH_RADIUS_M * np.cos(np.radians(start[0]))
    return {
        "latitude_deg": start[0] + np.degrees(north / EARTH_RADIUS_M),
        "longitude_deg": start[1] + np.degrees(east / parallel),
        "altitude_m": start[2] - down,
    }
