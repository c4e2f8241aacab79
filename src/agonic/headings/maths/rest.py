"""The gyro's bias where the log is at rest: what its rates read there.

A sensor at rest reads its bias, on all three axes, and the Earth's rotation. Rest is where rates
and acceleration keep still and the compass does not turn: a vehicle that turns slowly and evenly
feels the same as one at rest, and only its compass tells.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d

from agonic.arrays import Array, Index, Mask

SHORTEST_S = 3.0
"""Rates and acceleration have kept still for so long."""
STILL_RATE = float(np.radians(0.4))
"""rad/s: averages over half a second stay within, either way."""
STILL_FORCE = 0.2
"""m/s²: the same."""
LARGEST_RATE = float(np.radians(3.0))
"""rad/s: a common gyro has no larger bias."""
EARTH = 7.292e-5
"""rad/s: what the Earth's rotation adds, another share in each attitude."""
FEWEST = 10
"""Moments in which it has to tell."""


class Rest(NamedTuple):
    """Moments at rest, one a stretch: their numbers (r,), what the rates read there (r, 3), rad/s,
    and its variance by the gyro's noise and the Earth's rotation (r,)."""

    at: Index
    bias: Array
    variance: Array

    def subset(self, start: int, stop: int) -> Rest:
        """Those among moments in a row."""
        kept = (self.at >= start) & (self.at < stop)
        return Rest(self.at[kept] - start, self.bias[kept], self.variance[kept])


NO_REST = Rest(np.zeros(0, dtype=np.intp), np.zeros((0, 3)), np.zeros(0))


def find_still(time: Array, rate: Array, force: Array) -> Mask:
    """The rows (n,) where rates and acceleration (n, 3) keep still."""
    step = max(float(np.median(np.diff(time))), 1e-9)
    short, long = (max(round(span / step), 1) for span in (0.5, SHORTEST_S))
    if len(time) <= long:
        return np.zeros(len(time), dtype=bool)
    still = np.ones(len(time), dtype=bool)
    for values, most in ((rate, STILL_RATE), (force, STILL_FORCE)):
        mean = uniform_filter1d(values, short, axis=0, mode="nearest")
        high = maximum_filter1d(mean, long, axis=0, mode="nearest")
        still &= (high - minimum_filter1d(mean, long, axis=0, mode="nearest") < 2 * most).all(1)
    return np.asarray(still & (np.abs(rate).mean(axis=1) < 2 * LARGEST_RATE))


def find_rest(time: Array, rate: Array, still: Mask, compass: Array, noise: Array) -> Rest:
    """Where N moments are at rest, and what the rates (N, 3), less what is known of their bias,
    read; `noise` is the variance of the compass, rad², infinite where it tells nothing."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]])))
    found = []
    for start, stop in edges.reshape(-1, 2):
        span = slice(start, stop)
        lasted = float(time[stop - 1] - time[start])
        told = np.isfinite(noise[span])
        bias = rate[span].mean(axis=0)
        if lasted < SHORTEST_S or np.abs(bias).max() > LARGEST_RATE or told.sum() < FEWEST:
            continue
        when, angle = time[span][told], compass[span][told]
        when = when - when.mean()
        square = float(when @ when)
        turn = float(when @ angle) / square  # rad/s
        left = angle - angle.mean() - turn * when
        # neighbouring errors are alike: a second's count as one
        alike = max(1.0 / max(float(np.median(np.diff(when))), 1e-9), 1.0)
        turn_sd = float(np.sqrt(left @ left / max(len(when) - 2, 1) * alike / square))
        # standard errors by which the compass may seem to turn at rest; what it turns by beyond
        # one is doubted
        if abs(turn) > 3.0 * turn_sd:
            continue
        # halves of it tell the noise, and a bias that drifts
        noise_sd = rate[span].std(axis=0).max() / np.sqrt(stop - start)
        halves = [one.mean(axis=0) for one in np.array_split(rate[span], 2)]
        apart = np.abs(halves[1] - halves[0]).max() / 2
        doubt = max(turn**2 - turn_sd**2, 0.0)
        variance = noise_sd**2 + apart**2 + EARTH**2 + doubt
        found.append((start + (stop - start) // 2, bias, variance))
    if not found:
        return NO_REST
    at, biases, variances = zip(*found, strict=True)
    return Rest(np.array(at, dtype=np.intp), np.stack(biases), np.array(variances))
