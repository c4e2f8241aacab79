"""Robust centre and spread of a population whose members each have an error of their own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.one_pass import median

_HALF = 0.45493642311957283  # the median of χ² with one degree of freedom
_REACH = 4.685  # of Tukey's biweight: 95 % efficient for normal errors
_ENOUGH = 20_000  # members tell the spread to 1 %
_MANY, _BINS = (
    10_000,
    4096,
)  # values of which only those in the middle one of so many bins are sorted


class RobustSpread(NamedTuple):
    """Where a population lies and how far its members truly differ, each (k,)."""

    centre: Array
    spread: Array


def estimate_robust_spread(values: Array, sd: Array) -> RobustSpread:
    """Centre and spread of each column, with the errors of measurement taken out of the spread.

    Members are y = centre + spread·t + sd·e. The spread solves

        median (y − centre)² / (spread² + sd²) = 0.4549,

    the median absolute deviation where sd = 0, and is zero where the errors alone explain the
    differences; the centre is Tukey's biweight with the same scales. Up to half of the members
    may be anywhere. Parameters: values and sd (n, k), NaN where missing.
    """
    columns = zip(values.T, sd.T, np.isfinite(values).T, strict=True)
    centre, spread = np.array([_column(v[known], s[known]) for v, s, known in columns]).T
    return RobustSpread(centre, spread)


def _column(values: Array, sd: Array) -> tuple[float, float]:
    if not len(values):
        return np.nan, np.nan
    centre = median(values)
    variance = np.nan_to_num(sd, posinf=np.inf) ** 2
    spread = 0.0
    some = slice(None, None, 1 + len(values) // _ENOUGH)
    for _ in range(3):
        spread = _spread((values[some] - centre) ** 2, variance[some])
        centre = _centre(values, variance + spread**2, centre)
    return centre, spread


def _spread(square: Array, variance: Array) -> float:
    """The root of a function that falls with the spread, by halving the interval it lies in."""
    high = median(square) / _HALF  # no variance makes it larger
    if high <= float(variance.min()) or _median_ratio(square, variance, 0.0) <= _HALF:
        return 0.0
    low = max(high - float(variance.max()), 0.0)
    while high - low > 1e-3 * high:
        middle = 0.5 * (low + high)
        if _median_ratio(square, variance, middle) > _HALF:
            low = middle
        else:
            high = middle
    return float(np.sqrt(0.5 * (low + high)))


def _median_ratio(square: Array, variance: Array, own: float) -> float:
    total = variance + own
    ratio = np.full_like(square, np.inf)
    np.divide(square, total, out=ratio, where=total > 0)
    ratio[(total == 0) & (square == 0)] = 0.0
    return median(ratio)


def _centre(values: Array, variance: Array, centre: float) -> float:
    if not variance.min() > 0:  # more than half of the members are equal: they are the centre
        return centre
    for _ in range(10):
        z = (values - centre) ** 2 / (_REACH**2 * variance)
        weights = np.maximum(1.0 - z, 0.0) ** 2 / variance
        moved = float(weights @ values / weights.sum())
        done = abs(moved - centre) ** 2 < 1e-8 * float(variance.min())
        centre = moved
        if done:
            break
    return centre


def weighted_median(values: Array, weights: Array) -> float:
    """The value that half of the weight lies at or below."""
    below, half = 0.0, float(weights.sum()) / 2
    low, width = (float(values.min()), float(np.ptp(values))) if len(values) > _MANY else (0.0, 0.0)
    if np.finfo(float).tiny * _BINS < width < np.inf:  # those near the middle need an order only
        bins = ((values - low) * ((_BINS - 1) / width)).astype(np.intp)
        told = np.cumsum(np.bincount(bins, weights, _BINS)).astype(np.float64)
        at = int(np.searchsorted(told, half))
        near, below = bins == at, float(told[at - 1]) if at else 0.0
        values, weights = values[near], weights[near]
    order = np.argsort(values)
    running = below + np.cumsum(weights[order])
    last = min(int(np.searchsorted(running, half)), len(order) - 1)
    return float(values[order[last]])
