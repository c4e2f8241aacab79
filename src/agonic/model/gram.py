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
    if not n:
        return WHITE
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
"""Blocks of time: each is predicted from the others, and the bias may step between them."""
ROWS_PER_BLOCK = 3
"""At least, or a block says nothing."""


class Stack(NamedTuple):
    """One channel's rows: `columns` (m + 1, n), of parameters and terms, its residuals last, all
    times the square roots of the rows' weights."""

    name: str
    columns: Array


class Blocks(NamedTuple):
    """White columns (m + 1, n) of each channel, the first rows of the blocks of time and the end,
    (b + 1,), and the radius.

    Beside the columns stand steps of the bias before every block but the first, three columns each:
    one after its time and zero before, less its mean over the log. Within a block a step is a
    multiple of the bias' own columns, so that no row is needed.
    """

    white: list[Array]
    edges: Index
    radius: float

    @property
    def rows(self) -> Array:
        """How many rows each block has, (b,)."""
        return np.diff(self.edges).astype(float)

    @property
    def heights(self) -> Array:
        """How high each step is in each block, (b, places)."""
        rows = self.rows
        after = np.arange(len(rows))[:, None] >= np.arange(1, len(rows))
        return np.asarray(self.radius * (after - rows @ after / rows.sum()))

    def add(self) -> Array:
        """Cross-products of columns and steps over all rows, (c, m + k + 1, m + k + 1)."""
        heights, spans = self.heights, list(pairwise(self.edges))
        count, places = heights.shape
        both = (heights[:, :, None] * heights[:, None]).reshape(count, places**2).T
        m, k = len(self.white[0]) - 1, 3 * places
        sums = np.empty((len(self.white), m + k + 1, m + k + 1))
        for white, out in zip(self.white, sums, strict=True):
            by_bias = np.stack([white[:3, a:b] @ white[:, a:b].T for a, b in spans])
            across = (heights.T @ by_bias.reshape(count, -1)).reshape(k, m + 1)
            each = (both @ by_bias[:, :, :3].reshape(count, 9)).reshape(places, places, 3, 3)
            plain = white @ white.T
            out[:m, :m], out[:m, -1], out[-1, :m], out[-1, -1] = (
                plain[:m, :m],
                plain[:m, -1],
                plain[-1, :m],
                plain[-1, -1],
            )
            out[m:-1, :m], out[m:-1, -1] = across[:, :m], across[:, -1]
            out[:m, m:-1], out[-1, m:-1] = across[:, :m].T, across[:, -1]
            out[m:-1, m:-1] = each.transpose(0, 2, 1, 3).reshape(k, k)
        return sums

    def split(self, columns: Index, weights: Array) -> Array:
        """Cross-products of some columns and the residuals in each block, (b, k + 1, k + 1), summed
        over the channels by their weights (c,)."""
        m, heights = len(self.white[0]) - 1, self.heights
        place, axis = np.divmod(np.maximum(columns - m, 0), 3)
        plain = columns < m
        chosen = np.append(np.where(plain, columns, axis), m)
        size = np.ones((len(heights), len(chosen)))
        size[:, :-1][:, ~plain] = heights[:, place[~plain]]
        sums = size[:, :, None] * size[:, None, :]
        spans = list(pairwise(self.edges))
        products = np.zeros_like(sums)
        for white, weight in zip(self.white, weights, strict=True):
            some = white[chosen]
            for one, (a, b) in zip(products, spans, strict=True):
                one += weight * (some[:, a:b] @ some[:, a:b].T)
        return np.asarray(sums * products)


def count_blocks(rows: int) -> int:
    """How many blocks so many rows make."""
    return min(BLOCKS, max(rows // ROWS_PER_BLOCK, 1))
