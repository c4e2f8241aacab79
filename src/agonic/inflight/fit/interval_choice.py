"""How many intervals the bias needs in time: as many as make unseen readings fit better."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.errors import AgonicError
from agonic.inflight.fit.drift import DEGREE
from agonic.maths.estimation.noise.residuals import robust_scale

MOST_INTERVALS = 64
CERTAIN = 2.5
"""Standard errors, over the blocks, by which unseen readings must fit better for more knots."""
DOUBT = 1.0
"""Standard errors by which they may fit worse: wide errors are better than a swing missed."""
ROWS_AN_INTERVAL = 40
BLOCKS_AN_INTERVAL = 4
"""Blocks held out are this much shorter than the shortest interval, so that it is seen."""
_FEWEST_BLOCKS = 10
_CLIP = 4.0  # times the scale: so far an outlier counts

HeldOut = Callable[[Mask, int], Array]
"""Residuals (n,) of every row, nT, of a fit to the rows marked (n,) with so many intervals."""


def choose_intervals(
    asked: int | Literal["auto"], used: Mask, held_out: HeldOut
) -> tuple[int, dict[int, float]]:
    """How many intervals of drift, and the held-out error, nT, by the number of intervals tried.

    Until a drift is found each doubling is tried, up to the most that the rows allow, for a swing
    shows only once knots are closer than half of it. A drift is there where unseen readings fit
    better by `CERTAIN` standard errors; then as many intervals as they do not contradict by
    `DOUBT`, for what a stiff spline misses is in no standard error.

    Raises `AgonicError` for a number below zero.
    """
    if asked != "auto":
        if asked < 0:
            raise AgonicError(f"drift_knots is {asked}; it counts intervals, 0 for a constant bias")
        return asked, {}
    candidates = list_candidates(int(used.sum()))
    count = max(BLOCKS_AN_INTERVAL * candidates[-1], _FEWEST_BLOCKS)
    block = np.arange(len(used)) * count // len(used)
    best, errors = 0, {0: _residuals_unseen(held_out, used, block, 0)}
    for k in candidates[1:]:
        errors[k] = _residuals_unseen(held_out, used, block, k)
        if compute_certainty(errors[best], errors[k], block[used]) > (-DOUBT if best else CERTAIN):
            best = k
        elif best:  # more than these would be worse, and still more a matter of chance
            break
    return best, {k: robust_scale(error) for k, error in errors.items()}


def list_candidates(rows: int) -> list[int]:
    """The numbers of intervals to try.

    >>> list_candidates(500)
    [0, 1, 2, 4, 8]
    """
    doublings = [1 << k for k in range(MOST_INTERVALS.bit_length())]
    return [0, *(k for k in doublings if rows > ROWS_AN_INTERVAL * (k + DEGREE))]


def compute_certainty(before: Array, after: Array, block: Index) -> float:
    """By how many standard errors, over the blocks (n,), residuals (n,) are smaller than before.

    >>> block = np.arange(4)
    >>> round(compute_certainty(np.array([3.0, 4, 3, 4]), np.array([1.0, 1, 2, 2]), block), 1)
    4.5
    """
    limit = _CLIP * min(robust_scale(before), robust_scale(after))
    gained = np.minimum(before**2, limit**2) - np.minimum(after**2, limit**2)
    _, number = np.unique(block, return_inverse=True)
    by_block = np.bincount(number, gained)
    spread = float(np.std(by_block, ddof=1)) * np.sqrt(len(by_block))
    return float(by_block.sum() / max(spread, 1e-300))


def _residuals_unseen(held_out: HeldOut, used: Mask, block: Index, intervals: int) -> Array:
    """Residuals of the used rows, each by the fit to the other half of the blocks."""
    left = np.empty(len(used))
    for half in (block % 2 == 0, block % 2 == 1):
        left[half] = held_out(used & ~half, intervals)[half]
    return left[used]
