"""A bias that follows the orbit: errors of track and clock, and sunlight, which a spline hides."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from agonic.health import Finding, figure
from agonic.inflight.fit.likely_causes import EARTH_RADIUS_M, LOWEST_ORBIT_M
from agonic.samples import Samples

if TYPE_CHECKING:
    from agonic.inflight.fit.result import InflightFit
    from agonic.inflight.fit.sunlight import Sunlight

GRAVITY_M3_S2 = 3.986004418e14
WITHIN = 1 / 3
"""Share of an orbit below which an interval of the bias follows the orbit: a spline needs four for
what goes round once, and two hold slow heat too."""


def swings_with_orbit(fit: InflightFit, samples: Samples) -> bool:
    """Whether the spline of the bias has more than three intervals in an orbit."""
    period = find_period_s(samples)
    return period is not None and 0.0 < _interval_s(fit) < WITHIN * period


def judge_swing_with_orbit(fit: InflightFit, samples: Samples) -> list[Finding]:
    """A bias that changes within an orbit as only what goes round with it does."""
    period = find_period_s(samples)
    if period is None or not swings_with_orbit(fit, samples):
        return []
    return [
        Finding(
            "bias follows the orbit",
            "check",
            f"the bias asks for a knot every {figure(_interval_s(fit) / 60)} min, and an orbit "
            f"takes {figure(period / 60)}: rather than the bias of the sensor it follows an error "
            "of the clock or the track, sunlight, or heat, and its standard errors do not hold",
            "check clock, date and heights; fit with the temperature and the currents on board "
            "(--temperature, --with), and where the bias changes but slowly give --knots",
        )
    ]


def judge_sunlight(sunlight: Sunlight | None) -> list[Finding]:
    """A bias that is another in sunlight than in the shadow of the Earth."""
    if sunlight is None or not sunlight.sure:
        return []
    return [
        Finding(
            "sunlight",
            "check",
            f"the bias goes with the sunlight, by {figure(sunlight.size)} nT (rms over the "
            "record), which is in its standard error now",
            "record the currents of the solar panels and the temperature beside the sensor, and "
            "fit with them (--with, --temperature); beside an attitude, check that as well",
        )
    ]


def find_period_s(samples: Samples) -> float | None:
    """How long a circular orbit of the height takes, s; None where the log is of no orbit.

        T = 2π √(a³/GM)

    >>> at_500_km = Samples(field=np.ones((3, 3)), altitude_m=np.full(3, 5e5))
    >>> round(find_period_s(at_500_km))
    5668
    """
    if samples.altitude_m is None or np.median(samples.altitude_m) < LOWEST_ORBIT_M:
        return None
    radius = EARTH_RADIUS_M + float(np.median(samples.altitude_m))
    return float(2 * np.pi * np.sqrt(radius**3 / GRAVITY_M3_S2))


def _interval_s(fit: InflightFit) -> float:
    if not fit.drift.changes:
        return 0.0
    return (fit.drift.stop - fit.drift.start) / fit.drift.intervals
