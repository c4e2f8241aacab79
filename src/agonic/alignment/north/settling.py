"""A platform that still turns while an orientation is recorded: its magnetometer sees it."""

from __future__ import annotations

import numpy as np
from scipy.special import fdtrc

from agonic.arrays import Array

BATCHES = 6
"""Means of an orientation's readings, in which noise with memory shows as it is."""


def find_settling_chance(left: list[Array]) -> float:
    """How often chance alone would move readings along a line in time by as much as they do.

    Of each orientation batches of what is `left` (n, 3) of its readings are fitted with a line; the
    squares of the slopes over those of what the lines leave are an F-test, all axes together. It is
    1 where no orientation has readings enough.

    >>> rng = np.random.default_rng(0)
    >>> still = [rng.normal(size=(60, 3)) for _ in range(8)]
    >>> bool(find_settling_chance(still) > 1e-4)
    True
    >>> find_settling_chance([one - np.linspace(0, 3, 60)[:, None] for one in still]) < 1e-4
    True
    """
    explained, unexplained, lines = 0.0, 0.0, 0
    at = np.linspace(-1.0, 1.0, BATCHES)
    for values in left:
        if len(values) < BATCHES:
            continue
        means = np.stack([part.mean(axis=0) for part in np.array_split(values, BATCHES)])
        means -= means.mean(axis=0)
        slope = at @ means / (at @ at)
        explained += float((slope**2).sum() * (at @ at))
        unexplained += float(((means - np.outer(at, slope)) ** 2).sum())
        lines += 3
    if not lines or unexplained == 0.0:
        return 1.0
    freedom = lines * (BATCHES - 2)
    return float(fdtrc(lines, freedom, explained / lines / (unexplained / freedom)))
