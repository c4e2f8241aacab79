"""Gram blocks: cross-products of parameters, terms and residuals by blocks of time.

They are all that a fit keeps of its rows: sums of blocks give every estimate, covariance and
evidence, and blocks add over pieces of a log, workers and days. Noise with memory is whitened
before, by an autoregression.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array

MOST_LAGS = 12
ROWS_PER_LAG = 10
PRICE = 6.0
"""Of a lag, in twice the log-likelihood: so that one white log in a hundred gets one."""
WHITE = np.ones(1)
SHORT = 11
"""Lags that NumPy filters by in one loop; of more each row is a call, four times as slow."""


def fit_filter(residuals: Array) -> Array:
    """The filter (1, −a₁, …, −a_p) that whitens residuals (n,), its order by likelihood less
    `PRICE` a lag (Levinson's recursion on the autocovariances).

    >>> rng = np.random.default_rng(0)
    >>> len(fit_filter(rng.normal(size=2000)))
    1
    >>> walk = rng.normal(size=2000)
    >>> for k in range(1, 2000):
    ...     walk[k] += 0.9 * walk[k - 1]
    >>> bool(abs(fit_filter(walk)[1] + 0.9) < 0.05)
    True
    """
    n = len(residuals)
    most = min(MOST_LAGS, n // ROWS_PER_LAG)
    covariances = np.array([residuals[: n - k] @ residuals[k:] for k in range(most + 1)]) / n
    if not covariances[0] > 0.0:
        return WHITE
    weights, left = np.empty(0), float(covariances[0])
    best, cost = WHITE, n * np.log(left)
    for k in range(1, most + 1):
        reflection = (covariances[k] - weights @ covariances[k - 1 : 0 : -1]) / left
        weights = np.append(weights - reflection * weights[::-1], reflection)
        left *= 1.0 - reflection**2
        if not left > 0.0:
            break
        price = n * np.log(left) + PRICE * k
        if price < cost:
            best, cost = np.append(1.0, -weights), price
    return best


def whiten(rows: Array, by: Array, first: int, last: int) -> Array:
    """The columns from `first` to `last` of rows (k, n) of time filtered by (p + 1,); as they are
    where it is white."""
    if len(by) == 1:
        return rows[:, first:last]
    before = max(first - len(by) + 1, 0)
    white = np.empty((len(rows), last - first))
    for row, out in zip(rows[:, before:last], white, strict=True):
        full = np.convolve(row, by[:SHORT])[: len(row)]
        if len(by) > SHORT:
            full[SHORT:] += np.convolve(row[:-SHORT], by[SHORT:])[: len(row) - SHORT]
        out[:] = full[first - before :]
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
    """Cross-products by channel and block, (c, b, m + 1, m + 1), and rows of each block, (b,)."""

    sums: Array
    rows: Array


def count_blocks(rows: int) -> int:
    """How many blocks so many rows make."""
    return min(BLOCKS, max(rows // ROWS_PER_BLOCK, 1))


def add_up(stacks: list[Stack], filters: list[Array]) -> Blocks:
    """The cross-products of whitened columns."""
    n = stacks[0].columns.shape[1]
    edges = np.linspace(0, n, count_blocks(n) + 1).astype(int)
    sums = []
    for stack, by in zip(stacks, filters, strict=True):
        parts = (whiten(stack.columns, by, a, b) for a, b in pairwise(edges))  # each in the cache
        sums.append(np.stack([part @ part.T for part in parts]))
    return Blocks(np.stack(sums), np.diff(edges).astype(float))


def add_blocks(blocks: Blocks, radius: float) -> Array:
    """The sums over all blocks, by channel, with a step of the bias before every block but the
    first, three columns each: (c, m + k + 1, m + k + 1).

    A step is one after its time and zero before, less its mean over the log: within a block it is a
    multiple of the bias' own columns, so that no row is needed.
    """
    heights = _find_heights(blocks.rows, radius)
    across = np.einsum("cbij,bk->cikj", blocks.sums[..., :3], heights)
    own = np.einsum("cbij,bk,bl->ckilj", blocks.sums[..., :3, :3], heights, heights, optimize=True)
    return _join(blocks.sums.sum(axis=1), across, own)


def with_steps(sums: Array, rows: Array, radius: float) -> Array:
    """The same of each block, from sums (b, m + 1, m + 1) and rows (b,)."""
    heights = _find_heights(rows, radius)
    across = sums[:, :, None, :3] * heights[:, None, :, None]
    both = heights[:, :, None, None, None] * heights[:, None, None, :, None]
    return _join(sums, across, sums[:, None, :3, None, :3] * both)


def _find_heights(rows: Array, radius: float) -> Array:
    """How high each step is in each block, (b, places)."""
    count = len(rows)
    after = np.arange(count)[:, None] >= np.arange(1, count)
    return np.asarray(radius * (after - rows @ after / rows.sum()))


def _join(plain: Array, across: Array, own: Array) -> Array:
    """Cross-products (c, m + 1, m + 1) with those of steps put before the last column."""
    c, m, k = len(plain), plain.shape[-1] - 1, 3 * across.shape[2]
    across = across.reshape(c, m + 1, k)
    wider = np.empty((c, m + k + 1, m + k + 1))
    first, steps, last = slice(0, m), slice(m, m + k), m + k
    wider[:, first, first] = plain[:, :m, :m]
    wider[:, first, steps] = across[:, :m]
    wider[:, steps, first] = np.swapaxes(across[:, :m], 1, 2)
    wider[:, steps, steps] = own.reshape(c, k, k)
    wider[:, last, first] = wider[:, first, last] = plain[:, :m, m]
    wider[:, last, steps] = wider[:, steps, last] = across[:, m]
    wider[:, last, last] = plain[:, m, m]
    return wider
