"""Where a simulated satellite is: a Kepler orbit that the flattening of the Earth turns slowly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array
from agonic.errors import AgonicError
from agonic.maths.earth.geodesy import SEMI_MAJOR_M

GRAVITATION_M3_S2 = 3.986004418e14
OBLATENESS = 1.08262668e-3
"""μ and J2 of the Earth (NIMA TR8350.2, EGM96)."""


@dataclass(frozen=True, kw_only=True)
class Orbit:
    """Elements of an orbit at time zero, as two-line elements give them; nearly polar by default.

    `altitude_m` mean height above the equator's radius; `inclination_deg`, `node_deg` right
    ascension of the ascending node, `perigee_deg` argument of the perigee, `anomaly_deg` mean
    anomaly; equator and equinox of date.
    """

    altitude_m: float = 500_000.0
    inclination_deg: float = 97.4
    node_deg: float = 60.0
    perigee_deg: float = 0.0
    anomaly_deg: float = 0.0
    eccentricity: float = 0.0

    def __post_init__(self) -> None:
        lowest = self.semi_major_m * (1 - self.eccentricity) - SEMI_MAJOR_M
        if not (0 <= self.eccentricity < 1 and lowest > 100_000.0):
            raise AgonicError(
                f"an orbit of eccentricity {self.eccentricity} comes down to "
                f"{lowest / 1e3:.0f} km; it needs 100 km"
            )

    @property
    def semi_major_m(self) -> float:
        """Half the long axis, m."""
        return SEMI_MAJOR_M + self.altitude_m

    @property
    def motion_rad_s(self) -> float:
        """Mean motion √(μ/a³)."""
        return float(np.sqrt(GRAVITATION_M3_S2 / self.semi_major_m**3))

    @property
    def period_s(self) -> float:
        """2π over the mean motion, s."""
        return 2 * np.pi / self.motion_rad_s


def compute_state_i(orbit: Orbit, time: Array) -> tuple[Array, Array]:
    """Inertial position, m, and velocity, m/s, (3, n) each, at seconds (n,).

    Node and perigee move by the secular effect of J2: dΩ/dt = −3/2 J2 n (R/p)² cos i and
    dω/dt = 3/4 J2 n (R/p)² (5 cos² i − 1) (Vallado, Fundamentals of Astrodynamics, section 9.6).
    """
    tilt = np.radians(orbit.inclination_deg)
    e, a, rate = orbit.eccentricity, orbit.semi_major_m, orbit.motion_rad_s
    slow = 0.75 * OBLATENESS * rate * (SEMI_MAJOR_M / (a * (1 - e**2))) ** 2
    node = np.radians(orbit.node_deg) - 2 * slow * np.cos(tilt) * time
    perigee = np.radians(orbit.perigee_deg) + slow * (5 * np.cos(tilt) ** 2 - 1) * time
    mean = np.radians(orbit.anomaly_deg) + rate * time
    anomaly = mean
    for _ in range(10 if e > 0 else 0):  # M = E − e sin E
        anomaly = anomaly - (anomaly - e * np.sin(anomaly) - mean) / (1 - e * np.cos(anomaly))
    flat = np.sqrt(1 - e**2)
    swift = a * rate / (1 - e * np.cos(anomaly))
    along = np.stack([a * (np.cos(anomaly) - e), a * flat * np.sin(anomaly)])
    speed = np.stack([-swift * np.sin(anomaly), swift * flat * np.cos(anomaly)])
    to_node = np.stack([np.cos(node), np.sin(node), np.zeros_like(node)])
    flat_rise = np.stack([-np.sin(node), np.cos(node), np.zeros_like(node)])
    rising = np.cos(tilt) * flat_rise + np.array([[0.0], [0.0], [np.sin(tilt)]])
    cosine, sine = np.cos(perigee), np.sin(perigee)
    first, second = cosine * to_node + sine * rising, cosine * rising - sine * to_node
    return first * along[0] + second * along[1], first * speed[0] + second * speed[1]
