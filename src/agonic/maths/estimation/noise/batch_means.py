"""Batch means of the scores of a record: how long errors last.

The gradient of a fit is Σ_k g_k over stretches of time. White residuals scatter it by V; residuals
that go together in time, along a direction that turns as it does, scatter it by the sums of whole
batches of stretches instead, Σ_K (Σ_{k∈K} g_k)(…)ᵀ, once a batch outlasts them.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation.leastsq import inverse

STRETCHES = 2000
"""Stretches that a record is summed up in, at most."""
SHORTEST = 128
"""Rows in a stretch, at least."""

FEWEST_BATCHES = 8
"""Of a log, each with as many scores as there are unknowns: they tell a scatter."""
_CHANCE = 4.0  # standard deviations


def measure_correlation(scores: Array, white: Array) -> float:
    """For how many residuals errors last, by batches that are just long enough; 1 where none is.

    Parameters: scores (k, m) g_k in order of time; white (m, m), the scatter V of their sum if each
    residual is by itself. Batches double in length while that adds to tr(V⁻¹S)/m more than chance
    would, √(2/(m·batches)).

    Source: batch means, as for sums of correlated series (Künsch 1989; Lahiri 2003).
    """
    count, m = scores.shape
    centred = scores - scores.mean(axis=0)
    precision, found, size = inverse(white), 1.0, 1
    while count // size >= FEWEST_BATCHES:
        batches = count // size
        sums = centred[: batches * size].reshape(batches, size, m).sum(axis=1)
        ratio = float(np.sum((sums @ precision) * sums)) * count / (batches * size * m)
        doubt = _CHANCE if found == 1.0 else 1.0  # once something is correlated, more may be
        if ratio > found * (1 + doubt * np.sqrt(2 / (m * batches))):
            found = ratio
        size *= 2
    return found
