"""`with_course`: the course over ground as heading, for what cannot move sideways."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.maths.earth.geodesy import SEMI_MAJOR_M
from agonic.samples import Samples

WINDOW_S = 1.0
"""Half of the time over which a velocity is taken."""
SPEED_SD_M_S = 0.2
SLIP_DEG = 2.0
"""How far a car or a rover moves beside its nose, in turns and on slopes."""
CLEARLY = 5.0
UNKNOWN_SD_DEG = 180.0


def with_course(samples: Samples, *, speed_sd_m_s: float = SPEED_SD_M_S) -> Samples:
    """The samples with the course over ground as their heading, and its standard deviation.

        course = atan2(v_east, v_north),   sd² = (sd of a speed / speed)² + slip²

    where the speed is five times its own sd and more; elsewhere the sd is 180°. For a car or a
    rover that drives forwards, never for a boat, a plane or a copter, which drift aside.

    Parameters: samples with times and positions; `speed_sd_m_s` of a velocity over two seconds.
    Raises `LogError` without times or positions, or where nothing moved.

    >>> time = np.arange(0.0, 20.0, 0.5)
    >>> east = Samples(field=np.ones((40, 3)), time=time, latitude_deg=np.zeros(40),
    ...                longitude_deg=4e-5 * time, unit="nT")
    >>> float(with_course(east).heading_deg[20].round(1))
    90.0
    """
    time, latitude, longitude = samples.time, samples.latitude_deg, samples.longitude_deg
    if time is None or latitude is None or longitude is None:
        raise LogError(
            f"the course of {samples.name} needs times and positions (latitude_deg, longitude_deg)"
        )
    north = np.radians(latitude) * SEMI_MAJOR_M
    east = np.unwrap(np.radians(longitude)) * SEMI_MAJOR_M * np.cos(np.radians(latitude))
    velocity = [_differentiate(time, along) for along in (north, east)]
    speed = np.hypot(*velocity)
    known = speed > CLEARLY * speed_sd_m_s
    if not known.any():
        raise LogError(
            f"{samples.name} never moved faster than {float(speed.max()):.2g} m/s, so its course "
            f"is not known; drive faster than {CLEARLY * speed_sd_m_s:.2g} m/s"
        )
    sd = np.hypot(np.degrees(speed_sd_m_s / np.maximum(speed, speed_sd_m_s)), SLIP_DEG)
    course = np.degrees(np.arctan2(velocity[1], velocity[0])) % 360.0
    if samples.heading_deg is not None:
        course = np.where(known, course, samples.heading_deg)
    return samples.with_columns(
        heading_deg=course,
        heading_sd_deg=np.where(known, sd, UNKNOWN_SD_DEG),
        heading_source="the course over ground",
        heading_estimated=False,
    )


def _differentiate(time: Array, along: Array) -> Array:
    """The velocity over a window about each row."""
    before, after = time - WINDOW_S, time + WINDOW_S
    ahead, behind = np.interp(after, time, along), np.interp(before, time, along)
    span = np.minimum(after, time[-1]) - np.maximum(before, time[0])
    return np.asarray((ahead - behind) / np.maximum(span, 1e-3))
