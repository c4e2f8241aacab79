"""Batch means of the scores of a filter while it runs: how much larger its errors are than it says.

A filter's normalised innovations z_i are white where its noise model holds. With w_i their
normalised Jacobian by the state, the scores Σ w_i z_i of batches of readings scatter by C = Σ w wᵀ
then; errors that last, in the reference or in the sensor, scatter the sums of longer batches by
more. Its covariance P takes a score to an error P y, so the variance of number j is too small by

    f_j² = (P S P)_jj / (P C P)_jj,   S the mean of y yᵀ, C that of w wᵀ, of long batches.

Batches double in length from `SHORTEST` readings on; only sums are kept.

Source: batch means, as for sums of correlated series (Künsch 1989; Lahiri 2003); innovations are
white (Kailath 1968, IEEE Transactions on Automatic Control 13(6), 646–655).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from agonic.arrays import Array, Mask
from agonic.maths.estimation.noise.batch_means import SHORTEST

LENGTHS = 16
"""Lengths of batches: the longest has four million readings."""

_FEWEST = 4  # batches of one length that tell a scatter
_CHANCE = 1e-3  # of calling white noise correlated, all lengths and numbers together
_DOUBLINGS = 2  # over which a growth is measured
_GROWING = 1.3  # ratio from a length to its double above which longer batches would show more


class RunningBatchMeans(NamedTuple):
    """Sums over the batches so far.

    `score` (m,) of the unfinished batch and its `rows`; `information` (m, m) Σ w wᵀ over `total`
    readings of finished batches; of each length the `number` (k,) of batches, their `square`
    (k, m, m) Σ y yᵀ, and the score `waiting` (k, m) for its second half; `unsummed` the Jacobian
    and innovation of readings that are in `rows` and not yet in the sums (`sum_up`).
    """

    score: Array
    pending: Array
    rows: int
    total: int
    information: Array
    number: Array
    square: Array
    waiting: Array
    unsummed: tuple[tuple[list[float], float], ...] = ()


def start(m: int) -> RunningBatchMeans:
    """Nothing summed up yet, of scores with m numbers."""
    return RunningBatchMeans(
        np.zeros(m),
        np.zeros((m, m)),
        0,
        0,
        np.zeros((m, m)),
        np.zeros(LENGTHS),
        np.zeros((LENGTHS, m, m)),
        np.zeros((LENGTHS, m)),
    )


def add(before: RunningBatchMeans, jacobian: Array, innovation: Array) -> RunningBatchMeans:
    """With some readings more: normalised Jacobian (n, m) and innovation (n,)."""
    before, done = sum_up(before), 0
    while done < len(innovation):
        rows = slice(done, done + SHORTEST - before.rows)
        w, z = jacobian[rows], innovation[rows]
        score, pending = before.score + z @ w, before.pending + w.T @ w
        before = RunningBatchMeans(score, pending, before.rows + len(z), *before[3:8])
        done += len(z)
        if before.rows == SHORTEST:
            before = _finish(before)
    return before


def add_one(
    before: RunningBatchMeans, jacobian: list[float], innovation: float
) -> RunningBatchMeans:
    """`add` of one reading, which waits for the others of its batch."""
    unsummed = (*before.unsummed, (jacobian, innovation))
    after = RunningBatchMeans(before.score, before.pending, before.rows + 1, *before[3:8], unsummed)
    return _finish(sum_up(after)) if after.rows == SHORTEST else after


def sum_up(before: RunningBatchMeans) -> RunningBatchMeans:
    """The same with all its readings in the sums."""
    if not before.unsummed:
        return before
    w, z = map(np.array, zip(*before.unsummed, strict=True))
    return RunningBatchMeans(before.score + z @ w, before.pending + w.T @ w, *before[2:8])


def _finish(before: RunningBatchMeans) -> RunningBatchMeans:
    """With the batch that is full among those of its length, and of all that it completes."""
    count, square = before.number.copy(), before.square.copy()
    waiting, score = before.waiting.copy(), before.score
    for length in range(LENGTHS):
        count[length] += 1
        square[length] += np.outer(score, score)
        if count[length] % 2:
            waiting[length] = score
            break
        score = waiting[length] + score
    return RunningBatchMeans(
        np.zeros_like(before.score),
        np.zeros_like(before.pending),
        0,
        before.total + SHORTEST,
        before.information + before.pending,
        count,
        square,
        waiting,
    )


class Inflation(NamedTuple):
    """By how much each standard error is too small, `factor` (m,), 1 for enough; and whether still
    longer batches would show more, `growing`: then the factor is a guess."""

    factor: Array
    growing: bool


def compute_inflation(means: RunningBatchMeans, covariance: Array) -> Inflation:
    """By how much the standard errors of a covariance (m, m) are too small.

    Of each number the largest ratio of a length whose batches differ from white noise by more than
    chance, and at least the mean of all numbers: what one direction shows others may hide. Where
    the longest batches still show more than those half as long, as much more as twice all readings
    would: what wanders is estimated at its middle, and asked for at its end.
    """
    m = len(covariance)
    expected = np.diag(covariance @ means.information[:m, :m] @ covariance)
    lengths = int(np.count_nonzero(means.number >= _FEWEST))
    known = expected > 0
    if not lengths or not known.any():
        return Inflation(np.ones(m), False)
    squares = means.square[:lengths, :m, :m]
    seen = np.einsum("ia,kab,bi->ki", covariance, squares, covariance)[:, known]
    count = means.number[:lengths, None]
    rows = SHORTEST * 2.0 ** np.arange(lengths)
    ratio = seen / (count * rows[:, None] / means.total * expected[known])
    chance = chdtri(count, _CHANCE / ratio.size) / count
    significant = ratio > chance
    if not significant.any():
        return Inflation(np.ones(m), False)
    largest = np.max(np.where(significant, ratio, 1.0), axis=0)
    growth = _measure_growth(ratio, significant) if lengths > 1 else np.ones_like(largest)
    growing = growth > _GROWING
    doublings = 1.0 + np.log2(means.total / rows[-1])
    largest *= np.where(growing, np.minimum(growth, 2.0) ** doublings, 1.0)
    factor = np.ones(m)
    factor[known] = np.sqrt(np.maximum(largest, largest.mean()))
    return Inflation(factor, bool(growing.any()))


def _measure_growth(ratio: Array, significant: Mask) -> Array:
    """By how much the ratios (k, m) grow from one length to its double, over two doublings: of all
    numbers together, and of those whose own is significant, for the others may hide it."""
    steps = min(len(ratio) - 1, _DOUBLINGS)
    first, last = ratio[-1 - steps], ratio[-1]
    together = np.full(len(last), last.mean() / first.mean())
    own = np.where(significant[-1], last / np.maximum(first, 1.0), 0.0)
    return np.asarray(np.maximum(together, own) ** (1 / steps))
