"""The common mode of several series of the same thing, and what is each one's own.

Grubbs's estimators: what is common to two series cancels in their difference, what is each one's
own does not enter their covariance. Neither needs to know the truth.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array


class CommonMode(NamedTuple):
    """The `common` series (w, c), its standard deviation, and of each series its `own` (s,)."""

    common: Array
    common_sd: float
    own_sd: Array


def estimate_common_mode(series: Array) -> CommonMode:
    """The common mode of series (s, w, c), and the standard deviation of each one's own.

    With values y_i = common + own_i, own_i of variance q_i and all independent:

        E y_i y_j = common²,   E (y_i − y_j)² = q_i + q_j,

    averaged over all rows and columns. The common series is the mean weighted by 1/q. Needs at
    least two series, whose means are zero.

    Source: F. E. Grubbs, On estimating precision of measuring instruments and product variability,
    Journal of the American Statistical Association 43, 243–264, 1948.

    >>> rng = np.random.default_rng(0)
    >>> common = rng.normal(0.0, 5.0, (4000, 3))
    >>> own = np.array([1.0, 2.0, 3.0])[:, None, None] * rng.normal(size=(3, 4000, 3))
    >>> found = estimate_common_mode(common + own)
    >>> round(found.common_sd, 1), found.own_sd.round(1).tolist()
    (5.0, [1.0, 2.0, 3.0])
    """
    s = len(series)
    flat = series.reshape(s, -1)
    product = flat @ flat.T / flat.shape[1]
    between = float((product.sum() - np.trace(product)) / (s * (s - 1)))
    own = _own(product, between)
    least = max(float(np.max(own)) * 1e-3, np.finfo(float).tiny)
    weight = 1 / np.maximum(own, least)
    common = np.tensordot(weight / weight.sum(), series, axes=1)
    return CommonMode(common, float(np.sqrt(max(between, 0.0))), np.sqrt(np.maximum(own, 0.0)))


def _own(product: Array, between: float) -> Array:
    """The variance of each one's own, from the differences of pairs; two cannot be told so."""
    s = len(product)
    size = np.diag(product)
    if s == 2:
        return np.asarray(size - between)
    apart = size[:, None] + size[None, :] - 2 * product
    total = apart.sum() / (2 * (s - 1))
    return np.asarray((apart.sum(axis=1) - total) / (s - 2))
