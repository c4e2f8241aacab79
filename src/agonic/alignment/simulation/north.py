"""`simulate_north`: a night with a gyrotheodolite beside a turned platform, and its truth."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from scipy.optimize import brentq

from agonic.alignment.maths.north import evaluate_swing_deg
from agonic.alignment.session.laboratory import (
    NorthSession,
    Platform,
    Sighting,
    SwingRecord,
    Transits,
)
from agonic.alignment.simulation.session import TURN_S, make_clock, read_field, vary_field
from agonic.arrays import Array
from agonic.maths.rotations.attitude import make_rotation, rot_nb
from agonic.readable import Readable, Shown

MOST_VARIATION, PERIODS_S = 15.0, (2400.0, 3100.0, 5100.0)
READINGS = 20


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedNorth(Readable):
    """A session and its truth: north on the circle, the mark's azimuth, degrees, and R_mb."""

    session: NorthSession
    north_deg: Annotated[float, Shown()]
    mark_azimuth_deg: Annotated[float, Shown()]
    rot_mb: Annotated[Array, Shown(key="matrix_mb")]


def simulate_north(
    *,
    reading_sd_arcsec: float = 4.0,
    time_sd_s: float = 0.1,
    constant_sd_arcsec: float = 1.0,
    orientations: int = 8,
    noise: float = 0.5,
    reference_noise: float = 0.3,
    circle_sd_arcsec: float = 2.0,
    level_sd_arcsec: float = 2.0,
    seed: int = 0,
) -> SimulatedNorth:
    """A gyro read by its turning points, by transits and all the time; a mark; a platform.

    It swings for four periods about 35″ more than true north on the circle.

    Parameters
    ----------
    reading_sd_arcsec, time_sd_s : of a reading of the circle and of a stopped time.
    constant_sd_arcsec : of the constant as known.
    orientations : of the platform, 0 for none; it is turned about the vertical, tilted a little.
    noise, reference_noise : nT; circle_sd_arcsec, level_sd_arcsec : of its azimuth and tilt.
    seed : of the noise.

    Source: the equation of the gyro's swing, as in `fit_north`.

    >>> made = simulate_north()
    >>> len(made.session.turning_deg), len(made.session.platform.orientation)
    (8, 8)
    """
    rng = np.random.default_rng(seed)
    sd, constant_arcsec = reading_sd_arcsec / 3600.0, -35.0
    north_deg, mark_azimuth_deg = 137.2418, 211.5
    gyro = north_deg - (constant_arcsec + constant_sd_arcsec * rng.standard_normal()) / 3600.0
    phase = rng.uniform(0, 2 * np.pi)
    swing = np.array([gyro, 1.2 * np.cos(phase), 1.2 * np.sin(phase), 6e-5, 2 * np.pi / 420.0])
    time = np.arange(0.0, 4 * 420.0, 5.0)
    marks = north_deg + mark_azimuth_deg + np.array([0.0, 180.0, 0.0, 180.0])
    noises, sds = (noise, reference_noise), (circle_sd_arcsec, level_sd_arcsec)
    rot_mb, stood = _stand(orientations, north_deg, noises, sds, rng)
    return SimulatedNorth(
        session=NorthSession(
            name="simulated",
            turning_deg=_turning(swing, rng, sd),
            transits=_transits(swing, time_sd_s, rng, sd),
            swing=SwingRecord(
                time_s=time,
                reading_deg=evaluate_swing_deg(swing, time) + sd * rng.standard_normal(len(time)),
            ),
            reading_sd_arcsec=reading_sd_arcsec,
            time_sd_s=time_sd_s,
            constant_arcsec=constant_arcsec,
            constant_sd_arcsec=constant_sd_arcsec,
            sightings=(
                Sighting(name="mark", reading_deg=(marks + sd * rng.standard_normal(4)) % 360.0),
            ),
            noise=noise,
            reference_noise=reference_noise,
            **stood,
        ),
        north_deg=north_deg,
        mark_azimuth_deg=mark_azimuth_deg,
        rot_mb=rot_mb,
    )


def _turning(swing: Array, rng: np.random.Generator, sd: float) -> Array:
    """Readings at the turning points."""
    _, p, q, decay, omega = swing
    # u̇ = 0: tan(ωt − φ) = −λ/ω with p cos ωt + q sin ωt = A cos(ωt − φ)
    first = (np.arctan2(q, p) - np.arctan2(decay, omega)) / omega % (np.pi / omega)
    at = np.arange(first, 8 * np.pi / omega, np.pi / omega)
    return evaluate_swing_deg(swing, at) + sd * rng.standard_normal(len(at))


def _transits(swing: Array, time_sd_s: float, rng: np.random.Generator, sd: float) -> Transits:
    """Two transits at each of two settings, a swing apart, amplitudes in degrees."""
    settings = swing[0] + np.array([-0.11, -0.11, 0.16, 0.16]) + 0.02 * rng.standard_normal(4)
    settings[1], settings[3] = settings[0], settings[2]
    error = np.array([time_sd_s, time_sd_s, time_sd_s, sd, sd])
    rows = [
        _passages(swing, setting, 2 * k, error * rng.standard_normal(5))
        for k, setting in enumerate(settings)
    ]
    east, west, high, low = np.array(rows).T
    return Transits(
        setting_deg=settings, east_s=east, west_s=west, amplitude_east=high, amplitude_west=low
    )


def _passages(
    swing: Array, setting: float, periods: int, error: Array
) -> tuple[float, float, float, float]:
    """Times east and west of a setting and the amplitudes about it, after so many periods.

    `error` (5,) is that of the times of three passages and of the two amplitudes.
    """

    def away(t: float) -> float:
        return float(evaluate_swing_deg(swing, np.array([t]))[0]) - setting

    grid = 2 * np.pi / swing[4] * np.linspace(periods, periods + 2.2, 441)
    side = np.array([away(t) for t in grid])
    crossed = np.flatnonzero(np.diff(np.sign(side)) != 0)
    crossed = crossed[crossed >= crossed[side[crossed] < 0][0]][:3]
    exact = [brentq(away, grid[k], grid[k + 1]) for k in crossed]
    half_way = [np.linspace(*both, 201) for both in pairwise(exact)]
    high, low = (np.abs(evaluate_swing_deg(swing, at) - setting).max() for at in half_way)
    east, west = np.diff(exact + error[:3])
    return float(east), float(west), float(high + error[3]), float(low + error[4])


def _stand(
    count: int,
    north_deg: float,
    noise: tuple[float, float],
    sd_arcsec: tuple[float, float],
    rng: np.random.Generator,
) -> tuple[Array, dict[str, Any]]:
    """How the magnetometer sits on its platform, and of `count` orientations about the vertical
    platform, magnetometer and reference; `noise` is that of the two, `sd_arcsec` that of circle
    and level."""
    rot_mb = make_rotation(rng.uniform(-0.5, 0.5, 3))
    begins = datetime(2024, 3, 12, 20, 0, tzinfo=UTC)
    if not count:
        return rot_mb, {}
    heading = np.arange(count) * 360.0 / count + rng.uniform(-5, 5, count)
    roll, pitch = rng.uniform(-3, 3, (2, count))
    number = np.repeat(np.arange(count), READINGS)
    whole = make_clock(count, READINGS)
    seconds = whole.astype(np.float64)
    clock = np.arange(float(whole[-1] + TURN_S))
    beside = vary_field(clock, MOST_VARIATION, PERIODS_S, rng)
    true_b = np.einsum("nji,nj->ni", rot_nb(roll, pitch, heading)[number], beside[whole])
    circle_sd, level_sd = sd_arcsec
    roll_error, pitch_error = level_sd / 3600 * rng.standard_normal((2, count))
    read = heading + circle_sd / 3600 * rng.standard_normal(count)
    platform = Platform(
        orientation=np.arange(count) + 1,
        reading_deg=(read + north_deg + 180.0) % 360.0,
        roll_deg=roll + roll_error,
        pitch_deg=pitch + pitch_error,
        circle_sd_arcsec=circle_sd,
        level_sd_arcsec=level_sd,
        mirror=True,
    )
    station = (number + 1).astype(np.float64)
    return rot_mb, {
        "platform": platform,
        "magnetometer": read_field(
            true_b @ rot_mb.T, noise[0], rng, begins, seconds, station=station
        ),
        "reference": read_field(beside, noise[1], rng, begins, clock, "reference"),
    }
