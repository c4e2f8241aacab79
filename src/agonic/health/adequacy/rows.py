"""The rows of a fit that are tested."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.equation.crowding import choose_by_weight, weigh_crowded

MOST_ROWS, BLOCK = 20_000, 200
STAY, THINNED = 0.1, 0.5
"""A rest stays within this share of the radius; fewer of its rows are taken where less
than this share of all would stay."""


def choose_rows(readings: Array, radius: float) -> Index:
    """All rows, or blocks of consecutive ones spread evenly; few of a long rest.

    `radius` is that of the field in the units of the readings.
    """
    n = len(readings)
    weights = weigh_crowded(_find_stays(readings, STAY * radius))
    if weights.mean() < THINNED:  # at rest for most of the log
        spread = choose_by_weight(weights)
        if len(spread) < MOST_ROWS:
            return spread
    if n <= MOST_ROWS:
        return np.arange(n)
    starts = np.linspace(0, n - BLOCK, MOST_ROWS // BLOCK).astype(np.intp)
    return np.unique((starts[:, None] + np.arange(BLOCK)).ravel())


def _find_stays(readings: Array, reach: float) -> Index:
    """Numbers (n,) of stretches of rows that stay close to where they began.

    Only a rest is long. A vehicle comes by the same direction many times, and each time tells.
    """
    n = len(readings)
    size = min(max(10, -(-n // MOST_ROWS)), n)
    whole = readings[: n // size * size].reshape(-1, size, 3)
    middles = np.median(whole, axis=1)  # so that outliers end no rest
    stays, number = [], 0
    x0, y0, z0 = middles[0].tolist()
    for x, y, z in middles.tolist():  # plain numbers: an array a row takes ten times as long
        if max(abs(x - x0), abs(y - y0), abs(z - z0)) > reach:
            number, x0, y0, z0 = number + 1, x, y, z
        stays.append(number)
    return np.array(stays)[np.minimum(np.arange(n) // size, len(middles) - 1)]
