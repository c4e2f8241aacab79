"""Batch means of the scores of a record: correlated errors and change points.

The gradient of a fit is Σ_k g_k over stretches of time. White residuals scatter it by V; residuals
that go together in time, along a direction that turns as it does, scatter it by the sums of whole
batches of stretches instead, Σ_K (Σ_{k∈K} g_k)(…)ᵀ, once a batch outlasts them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation.leastsq import inverse

STRETCHES = 2000
"""Stretches that a record is summed up in, at most."""
SHORTEST = 128
"""Rows in a stretch, at least."""

FEWEST_BATCHES = 8
"""Of a log, each with as many scores as there are unknowns: they tell a scatter."""
_FEWEST = 30  # batches that tell a scatter
_CHANCE = 4.0  # standard deviations
_EDGE = 0.02  # of the record: a part shorter than this is no part


class Scatter(NamedTuple):
    """How the gradient scatters (m, m), and the correlation length, in residuals."""

    matrix: Array
    correlation: float


def compute_scatter(
    scores: Array, white: Array, *, steady: bool = False, fewest: int = _FEWEST
) -> Scatter:
    """The scatter of Σ_k g_k by the batches that are just long enough; V where none is.

    Parameters: scores (k, m) g_k in order of time; white (m, m) V; `steady` takes differences from
    batch to batch, which a change or drift does not touch; `fewest` batches that tell a scatter.
    Batches double in length while that
    adds to tr(V⁻¹S)/m more than chance would, √(2/(m·batches)).

    Source: batch means, as for sums of correlated series (Künsch 1989; Lahiri 2003).

    >>> rng = np.random.default_rng(0)
    >>> alone, slow = rng.normal(size=(2000, 2)), np.repeat(rng.normal(size=(200, 2)), 10, axis=0)
    >>> compute_scatter(alone, 2000 * np.eye(2)).correlation
    1.0
    >>> 7 < compute_scatter(slow, 2000 * np.eye(2)).correlation < 13
    True
    """
    count, m = scores.shape
    centred = scores - scores.mean(axis=0)
    precision = inverse(white)
    best, size = Scatter(white, 1.0), 1
    while count // size >= fewest:
        batches = count // size
        sums = centred[: batches * size].reshape(batches, size, m).sum(axis=1)
        share = batches * size / count
        if steady:
            sums, share = np.diff(sums, axis=0), 2 * share * (batches - 1) / batches
        matrix = sums.T @ sums / share
        ratio = float(np.trace(precision @ matrix)) / m
        doubt = (
            _CHANCE if best.correlation == 1.0 else 1.0
        )  # once something is correlated, more may be
        if ratio > best.correlation * (1 + doubt * np.sqrt(2 / (m * batches))):
            best = Scatter(matrix, ratio)
        size *= 2
    return best


class ChangePoint(NamedTuple):
    """The stretch from which on parameters are others, by how much (m,), and χ² against chance."""

    stretch: int
    shift: Array
    significance: float


def find_change_point(scores: Array, information: Array, white: Array) -> ChangePoint | None:
    """The likeliest moment at which parameters changed, by the running sum of scores.

    At the minimum of the whole the scores add up to zero; with parameters that change they first
    run away: with C the sum up to a share τ, χ² = Cᵀ V⁻¹ C/(τ (1 − τ)).

    Parameters: scores (k, m), information and white scatter (m, m) of all of them.

    Source: Lagrange multiplier test with an unknown moment (Andrews 1993).

    >>> rng = np.random.default_rng(0)
    >>> moved = rng.normal(size=(1000, 1)) + np.where(np.arange(1000) < 300, 0.7, -0.3)[:, None]
    >>> found = find_change_point(moved, 1000 * np.eye(1), 1000 * np.eye(1))
    >>> abs(found.stretch - 300) < 20, found.significance > 30
    (True, True)
    """
    count = len(scores)
    edge = max(int(_EDGE * count), 1)
    if count <= 2 * edge:
        return None
    share = np.arange(edge, count - edge + 1) / count
    runs = np.cumsum(scores - scores.mean(axis=0), axis=0)[edge - 1 : count - edge]
    statistic = np.einsum("ki,ij,kj->k", runs, inverse(white), runs) / (share * (1 - share))
    at = int(np.argmax(statistic))
    shift = inverse(information) @ runs[at] / (share[at] * (1 - share[at]))
    return ChangePoint(at + edge, np.asarray(shift), float(statistic[at]))
