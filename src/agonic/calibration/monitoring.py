"""`MonitorParams`: what a monitor of two whole compasses knows before, and when it raises an alarm.

Four groups of residuals are watched, each a linear function of four regressors x while all is well:

    r = f₁ − f₂ (3), nT               x = (1, f/F)     calibrations, turn between the housings
    q = down₁ − down₂ (2), rad        x = (1, down)    zeros of the inclinometers, turn
    s = (|f₁| + |f₂|)/2 − F (1), nT   x = (1, f/F)     errors both calibrations share
    v = mean of fᵢ·downᵢ − |fᵢ| sin dip (1), nT   x = (1, north_x, north_y, turn · north_y)   zeros
        that both share, and how turns lean them

The first two tell that something changed, the last two which of the compasses it was.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import chdtri, gammaln, ndtr

from agonic.arrays import Array
from agonic.calibration.base import Calibration
from agonic.calibration.setup import Setup
from agonic.calibration.steps import compute_composed_covariance, find_magnitude
from agonic.errors import AgonicError
from agonic.units import RAW

BLOCK_S = 3.0
"""Rows are averaged over it."""
LENGTHS, KEPT = (8, 16), 20
"""Blocks of the windows whose means are tested; and those that are kept, a minute, in which a fault
is to be named."""
PASSING = 5
"""Blocks, 15 s: what passes in less never alarms, however large it is."""
DIMENSIONS = (3, 2, 1, 1)
"""Numbers in each group: r, q, s, v."""
MEMORY = 600
"""Blocks, half an hour, over which the regressions forget: longer than turns, shorter than a day's
temperature."""
NOISE_MEMORY, NOISE_PRIOR = 2400, 40
"""Blocks over which variances are averaged, two hours, and those that a prior counts for."""
ODDS = 200.0
"""That one compass is at fault and not the other, for it to be named: wrong once in so many."""
TURNED = np.radians(2.0) * BLOCK_S
"""Turns in which inclinometers lean by more than a degree at 5 m/s, v ω/g, so that it is no longer
proportional to the rate: the vertical intensity is not looked at."""
QUIET = 9.0
"""What one square may add to a variance, over it: three standard deviations."""
LASTING = 0.98
"""The most that ρ is taken to be: a correlation time of 150 s, longer than the window."""
BOTH = 5.0
"""Both strengths off by so many standard deviations are a field that both feel."""
TAILS = 8.0
"""Degrees of freedom of Student's t for the common residuals, whose tails are those of manoeuvres
and iron beside the road. Source: Lange, Little & Taylor (1989), Journal of the American Statistical
Association 84, 881–896."""
UNSTATED_SHARE = 0.01
"""Errors of a calibration without covariance, and of an inclinometer (`RECORDED_SD_DEG`)."""
NOISE_NT, NOISE_TILT = 100.0, np.radians(0.15)
"""Of means over a window, until they are measured: drifts of common sensors in minutes."""


@dataclass(frozen=True, kw_only=True)
class MonitorParams:
    """What is known before, and how often a false alarm may be.

    Parameters
    ----------
    field, horizontal : of the place, nT: magnitude and its level part.
    prior_sd : (4,) of a coefficient of each regression, before it is learned: r, q, s, v.
    noise_sd : (4,) of the mean of a window of each, before it is measured.
    false_alarm_h : mean time between false alarms, hours.

    >>> MonitorParams(field=50_000.0, horizontal=20_000.0).alarm.round(1).tolist()
    [[42.8, 42.3], [39.4, 39.0]]
    """

    field: float
    horizontal: float
    prior_sd: tuple[float, float, float, float] = (1000.0, 0.03, 500.0, 500.0)
    noise_sd: tuple[float, float, float, float] = (NOISE_NT, NOISE_TILT, NOISE_NT, NOISE_NT)
    false_alarm_h: float = 10 * 8766.0  # ten years

    @cached_property
    def alarm(self) -> Array:
        """(2, 2) thresholds of r and q for each window, χ² where the variances are known.

        Each of the four tests has a quarter of the false alarms.
        """
        rate = BLOCK_S / 3600.0 / self.false_alarm_h / (2 * len(LENGTHS))
        return np.array([[find_threshold(p, n, rate) for n in LENGTHS] for p in DIMENSIONS[:2]])


def find_threshold(dimensions: int, length: int, rate: float) -> float:
    """The level b² that χ² of a moving mean over n values crosses upwards at this rate per value.

        rate = (2/n) b² p(b²) ν(b √(2/n)),   p the density of χ²

    of white values; errors that last cross it less often.

    Source: Pickands (1969), Transactions of the American Mathematical Society 145, 51–73, for
    correlations 1 − |t|/n, with the correction ν for discrete time of D. Siegmund (1985),
    Sequential Analysis, Springer, and for χ² D. Aldous (1989), Probability Approximations via the
    Poisson Clumping Heuristic, Springer.
    """
    half = dimensions / 2.0
    level = float(chdtri(dimensions, rate))
    for _ in range(60):  # a fixed point: what is in front of the exponential changes slowly
        x = np.sqrt(2.0 * level / length)
        density = ndtr(x / 2) - 0.5
        slope = np.exp(-(x**2) / 8) / np.sqrt(2 * np.pi)
        overshoot = (2 / x) * density / ((x / 2) * ndtr(x / 2) + slope)
        front = 2.0 / length * level * overshoot * level ** (half - 1) / 2.0**half
        level = float(2.0 * (np.log(front) - gammaln(half) - np.log(rate)))
    return level


def derive_monitor_params(
    setup: Setup, field: float | None, horizontal: float | None
) -> MonitorParams:
    """The params of a setup's two compasses.

    Parameters: the `setup`; `field` and `horizontal`, magnitude and level part to expect, nT,
    `None` for that of the calibrations and half of it.

    Raises `AgonicError` where the setup has not two compasses in nanotesla.

    >>> from agonic.calibration.affine import Affine
    >>> from agonic.calibration.setup import Compass
    >>> two = [Affine(bias=[0, 0, 0], matrix=np.eye(3), sensor=name) for name in ("a", "b")]
    >>> setup = Setup(compasses=[Compass(calibration=one) for one in two])
    >>> derive_monitor_params(setup, 50_000.0, 20_000.0).field
    50000.0
    """
    pair = [compass.calibration for compass in setup.compasses]
    if len(pair) != 2 or any(c.unit_out == RAW for c in pair):
        raise AgonicError(
            f"a monitor compares two calibrated compasses in nT and the setup has {len(pair)}; "
            "give a setup with two, each calibrated with the strength of the field"
        )
    size = field or next((m for m in map(find_magnitude, pair) if m), 50_000.0)
    level = horizontal or size / 2.0
    own = [_find_field_sd(one, size) for one in pair]
    # how well the two housings are in line: calibrated into body axes, and left in their own
    turn = np.radians(1.0 if all(one.frame_out == "b" for one in pair) else 30.0)
    both = float(np.hypot(own[0], own[1]))
    tilt = np.radians(0.5) if setup.tilt_sd_deg is None else float(np.radians(setup.tilt_sd_deg))
    return MonitorParams(
        field=size,
        horizontal=level,
        prior_sd=(
            float(np.hypot(both, turn * size)),
            float(np.hypot(2**0.5 * tilt, turn)),
            both / 2 + UNSTATED_SHARE * size,  # the world model leaves the crust out
            both / 2 + UNSTATED_SHARE * size + tilt * level,
        ),
        noise_sd=(NOISE_NT, NOISE_TILT, NOISE_NT, float(np.hypot(NOISE_NT, NOISE_TILT * level))),
    )


def _find_field_sd(calibration: Calibration, size: float) -> float:
    """How far the field of a calibration may be off on an axis, nT."""
    covariance = compute_composed_covariance(calibration)
    if covariance is None:
        return UNSTATED_SHARE * size
    spread = np.diag(covariance)
    return float(np.sqrt(spread[:3].mean() + spread[3:].mean() * 3 * size**2))
