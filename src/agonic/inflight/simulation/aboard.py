"""What a simulated satellite does and meets: attitude, heat, drifts, torquers, outer field."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array, Mask
from agonic.inflight.simulation.kepler import Orbit, compute_state_i
from agonic.maths.earth.earth_rotation import is_in_shadow, rotate_about_third, sidereal_rad, sun_i
from agonic.maths.earth.geodesy import SEMI_MAJOR_M, geodetic, north_east_down
from agonic.maths.earth.geodesy import directions as place
from agonic.maths.estimation.noise.autoregression import autoregress
from agonic.simulation.draws import draw_directions, draw_smooth
from agonic.simulation.motions import draw_tumbling

Pointing = Literal["nadir", "tumble"]

DIPOLE_E = np.array([0.0478, -0.1539, 0.9869])
"""The north geomagnetic pole of 2026, 80.7° N, 72.8° W, from g11, h11 and g10 of IGRF-14."""
ACROSS = 0.5
"""Share of the ring current's field that is seen square to the dipole."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Way:
    """A satellite's way: inertial `position` and `velocity` (3, n), `sidereal` time (n,), rad,
    `eclipse` (n,), and latitude, longitude, altitude as `columns`."""

    position: Array
    velocity: Array
    sidereal: Array
    eclipse: Mask
    columns: dict[str, Array]

    def in_n(self, vectors_e: Array) -> Array:
        """Earth-fixed vectors (3, n) in north, east, down along the way."""
        there = place(self.columns["latitude_deg"], self.columns["longitude_deg"])
        return north_east_down(vectors_e, there)


def find_way(orbit: Orbit, time: Array, epoch: datetime) -> Way:
    """Where the orbit leads from that moment on."""
    start = epoch.replace(tzinfo=UTC) if epoch.tzinfo is None else epoch
    unix = start.timestamp() + time
    position, velocity = compute_state_i(orbit, time)
    sidereal = sidereal_rad(unix)
    places = geodetic(rotate_about_third(position, sidereal))
    names = ("latitude_deg", "longitude_deg", "altitude_m")
    return Way(
        position=position,
        velocity=velocity,
        sidereal=sidereal,
        eclipse=is_in_shadow(position, sun_i(unix), SEMI_MAJOR_M),
        columns=dict(zip(names, places, strict=True)),
    )


def draw_attitude_nb(
    rng: np.random.Generator, time: Array, way: Way, pointing: Pointing, pace_s: float
) -> Rotation:
    """The attitude along the way.

    Nadir: x near the velocity and z to the centre of the Earth, under a wobble of 3° on each
    axis. Tumble: uniform random attitudes against the stars every `pace_s`, joined smoothly.
    """
    if pointing == "tumble":
        rot_ib = draw_tumbling(rng, time[-1], pace_s)(time)
        return _in_n(np.moveaxis(rot_ib.as_matrix(), 0, -1), way)
    down = -way.position / np.linalg.norm(way.position, axis=0)
    right = np.cross(down, way.velocity, axis=0)
    right /= np.linalg.norm(right, axis=0)
    level = _in_n(np.stack([np.cross(right, down, axis=0), right, down], axis=1), way)
    wobble = [draw_smooth(rng, time[-1], sd=3.0, pace_s=pace_s)(time) for _ in range(3)]
    return level * Rotation.from_rotvec(np.radians(np.stack(wobble, axis=1)))


def _in_n(rot_ib: Array, way: Way) -> Rotation:
    """Attitudes against inertial axes, matrices (3, 3, n), as attitudes against n axes."""
    axes_n = [way.in_n(rotate_about_third(rot_ib[:, k], way.sidereal)) for k in range(3)]
    return Rotation.from_matrix(np.moveaxis(np.stack(axes_n, axis=1), -1, 0))


def draw_external_n(
    rng: np.random.Generator, time: Array, way: Way, sd: float, correlation_s: float
) -> Array:
    """The field of the ring current (n, 3), north-east-down, nT.

    The same everywhere on Earth at a moment; along the dipole's axis with `sd`, across it with
    half; Gauss–Markov in time.
    """
    across = np.cross(DIPOLE_E, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    axes_e = np.stack([DIPOLE_E, across, np.cross(DIPOLE_E, across)])
    kept = np.exp(-_interval(time) / correlation_s)
    white = rng.standard_normal((len(time), 3))
    white[1:] *= np.sqrt(1 - kept**2)
    vectors_e = autoregress(white, kept) * sd * np.array([1.0, ACROSS, ACROSS]) @ axes_e
    return way.in_n(vectors_e.T).T


def follow_temperature(
    way: Way, time: Array, equilibrium_C: tuple[float, float], settling_s: float
) -> Array:
    """The temperature (n,), begun half-way, that follows shadow and sunlight with a lag.

    dT/dt = (T∞ − T)/τ, T∞ being the first of `equilibrium_C` in shadow and the second in the Sun.
    """
    shadow, sunlight = equilibrium_C
    heading_for = np.where(way.eclipse, shadow, sunlight)
    kept = np.exp(-_interval(time) / settling_s)
    start = (shadow + sunlight) / 2
    return start + autoregress((1 - kept) * (heading_for - start), kept)


def draw_drift(
    rng: np.random.Generator, time: Array, *, drift: float, walk_nT_h: float, jump: float, at: float
) -> Array:
    """How the bias has moved (n, 3) since the first row, nT: steadily, at random and in a step."""
    steady, step = draw_directions(rng, 2)
    share = time / max(time[-1], _interval(time))
    steps = rng.standard_normal((len(time), 3)) * np.sqrt(_interval(time) / 3600.0)
    steps[0] = 0.0
    walk = walk_nT_h * np.cumsum(steps, axis=0)
    return np.outer(share, drift * steady) + np.outer(share >= at, jump * step) + walk


def draw_pulses(
    rng: np.random.Generator, time: Array, size: float, share: float
) -> tuple[Array, Mask]:
    """What torquers add (n, 3), nT, in pulses of 20 s of random direction, and when they are on."""
    number = (time // 20.0).astype(np.intp)
    on = rng.uniform(size=number[-1] + 1) < share
    each = size * draw_directions(rng, number[-1] + 1)
    return on[number, None] * each[number], np.asarray(on[number])


def settle(values: Array, time: Array, settling_s: float) -> Array:
    """Values (n, 3) as they are reached after a switch: dy/dt = (x − y)/τ, begun at rest."""
    if not settling_s:
        return values
    kept = float(np.exp(-_interval(time) / settling_s))
    return autoregress((1.0 - kept) * values, kept)


def _interval(time: Array) -> float:
    return float(time[1] - time[0]) if len(time) > 1 else 1.0
