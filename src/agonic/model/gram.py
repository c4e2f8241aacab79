"""Gram blocks: cross-products of parameters, terms and residuals by blocks of time.

Sums of blocks give every estimate, covariance and evidence; a block less gives what the others
foretell of it. Noise with memory is whitened before, by an autoregression.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index

MOST_LAGS = 12
ROWS_PER_LAG = 10
LAG_PRICE = 6.0
"""Of a lag, in twice the log-likelihood: so that one white log in a hundred gets one."""
WHITE = np.ones(1)
LOOP_LAGS = 11
"""Lags that NumPy filters by in one loop; of more each row is a call, four times as slow."""


def fit_filter(residuals: Array) -> Array:
    """The filter (1, −a₁, …, −a_p) that whitens residuals (n,), its order by likelihood less
    `LAG_PRICE` a lag. What p lags leave of the variance is a pivot of the autocovariances' Cholesky
    factor."""
    n = len(residuals)
    most = min(MOST_LAGS, n // ROWS_PER_LAG)
    covariances = np.correlate(np.append(residuals, np.zeros(most)), residuals) / n
    if not covariances[0] > 0.0:
        return WHITE
    from scipy.linalg.lapack import dpotrf  # here, so that what only reads a log loads no SciPy

    lags = np.arange(most + 1)
    matrix = covariances[np.abs(lags[:, None] - lags)]
    factor, failed = dpotrf(matrix, lower=1)
    left = np.diag(factor)[: failed - 1 if failed else None] ** 2
    p = int(np.argmin(n * np.log(left) + LAG_PRICE * lags[: len(left)]))
    if p == 0:
        return WHITE
    return np.append(1.0, -np.linalg.solve(matrix[:p, :p], covariances[1 : p + 1]))


def whiten(rows: Array, by: Array) -> Array:
    """Rows (k, n) of time filtered by (p + 1,); as they are where it is white."""
    if len(by) == 1:
        return rows
    white = np.empty_like(rows)
    for row, out in zip(rows, white, strict=True):  # one by one they stay in the cache
        out[:] = np.convolve(row, by[:LOOP_LAGS])[: len(row)]
        if len(by) > LOOP_LAGS:
            out[LOOP_LAGS:] += np.convolve(row[:-LOOP_LAGS], by[LOOP_LAGS:])[: len(row) - LOOP_LAGS]
    return white


BLOCKS = 16
"""Blocks of time: each is predicted from the others."""
ROWS_PER_BLOCK = 3
"""At least, or a block says nothing."""


class Stack(NamedTuple):
    """One channel's rows: `columns` (m + 1, n), of parameters and terms, its residuals last, all
    times the square roots of the rows' weights."""

    name: str
    columns: Array


class Blocks(NamedTuple):
    """White columns (m + 1, n) of each channel, and the first rows of the blocks of time and the
    end, (b + 1,)."""

    white: list[Array]
    edges: Index

    @property
    def rows(self) -> Array:
        """How many rows each block has, (b,)."""
        return np.diff(self.edges).astype(float)

    def add(self) -> Array:
        """Cross-products of columns over all rows, (c, m + 1, m + 1)."""
        return np.stack([white @ white.T for white in self.white])

    def split(self, columns: Index, weights: Array) -> Array:
        """Cross-products of some columns and the residuals in each block, (b, k + 1, k + 1), summed
        over the channels by their weights (c,)."""
        chosen = np.append(columns, -1)
        spans = list(pairwise(self.edges))
        products = np.zeros((len(spans), len(chosen), len(chosen)))
        for white, weight in zip(self.white, weights, strict=True):
            some = white[chosen]
            for one, (a, b) in zip(products, spans, strict=True):
                one += weight * (some[:, a:b] @ some[:, a:b].T)
        return products


def count_blocks(rows: int) -> int:
    """How many blocks so many rows make."""
    return min(BLOCKS, max(rows // ROWS_PER_BLOCK, 1))
