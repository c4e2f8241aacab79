"""Waves along the readings of an axis, as of a converter that skips codes or repeats an error."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.health.adequacy.fitted import Work
from agonic.health.resolution import find_steps

BINS = 4096
FEWEST_WAVES, STEPS_PER_WAVE = 2, 2.5
"""Waves across the readings that no bend makes; steps of the readings in the shortest one."""


class Ripples(NamedTuple):
    """The frequency (3,) per radius that residuals show most along each axis; triples tried."""

    frequencies: Array
    trials: int


def find_ripples(work: Work) -> Ripples | None:
    """The waves along each axis by which residuals go most; None where readings hardly move.

    A wave of an axis shows by the normal n: |Σ w n r exp(2πi f x)|²/Σ w n², for all f by a Fourier
    transform of sums over narrow bins of x.
    """
    fit, x = work.linear, work.feet
    low, high = x.min(axis=0), x.max(axis=0)
    width = float((high - low).max())
    steps = find_steps(work.fitted.readings[work.rows]) / work.radius
    if not width > 0:
        return None
    frequencies = np.arange(BINS // 2 + 1) / width
    finest = max(float(steps.max()) * STEPS_PER_WAVE, width / BINS * 4)
    allowed = (frequencies >= FEWEST_WAVES / width) & (frequencies <= 1.0 / finest)
    if not allowed.any():
        return None
    found = np.zeros(3)
    for axis in range(3):
        seen = fit.weights * work.normals[:, axis] * fit.residuals
        bins = np.minimum(((x[:, axis] - low[axis]) / width * BINS).astype(np.intp), BINS - 1)
        power = np.abs(np.fft.rfft(np.bincount(bins, seen, BINS))) ** 2
        found[axis] = frequencies[np.argmax(np.where(allowed, power, 0.0))]
    return Ripples(found, int(allowed.sum()) ** 3)
