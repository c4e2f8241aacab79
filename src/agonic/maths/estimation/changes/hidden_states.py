"""The likeliest path through hidden states, where each switch has a price (Viterbi 1967)."""

from __future__ import annotations

from math import isqrt

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array


def find_path(cost: Array, price: float) -> NDArray[np.int8]:
    """The states (n,) that make the sum of costs and prices least.

        Σ cost[s_i, i] + price · #(s_i ≠ s_{i−1})

    Sums over blocks of rows, from each state before to each state behind, are made for all blocks
    at once; least sums through all of them then say where each block begins.

    Parameters: `cost` (k, n), minus the logarithm of the likelihood of row i in state s."""
    k, n = cost.shape
    length = isqrt(n) + 1
    count = -(-n // length)
    padded = np.pad(cost, ((0, 0), (0, count * length - n)))
    blocks = padded.reshape(k, count, length).transpose(2, 0, 1)
    apart = np.where(np.eye(k, dtype=bool), 0.0, np.inf)
    across = _add_up(blocks, price, np.repeat(apart[:, :, None], count, axis=2))[-1]
    first = np.zeros((k, count))
    for i in range(1, count):
        first[:, i] = (first[:, i - 1, None] + across[:, :, i - 1]).min(axis=0)
    totals = _add_up(blocks, price, first).transpose(2, 0, 1)
    before, last = totals[:, :-1].reshape(-1, k), totals[-1, -1]
    rows = [np.flatnonzero(one) for one in (before > before.min(axis=1)[:, None] + price).T]
    path, end, state = np.zeros(count * length, dtype=np.int8), count * length, int(last.argmin())
    while end > 0:  # from the row on in which the path switched to its state
        i = int(np.searchsorted(rows[state], end))
        start = int(rows[state][i - 1]) if i else 0
        path[start:end] = state
        end, state = start, int(before[start].argmin())
    return path[:n]


def _add_up(blocks: Array, price: float, first: Array) -> Array:
    """Least sums before every row of the blocks (l, k, b) and behind the last, from `first`
    (…, k, b) on: (l + 1, …, k, b)."""
    totals = np.empty((len(blocks) + 1, *first.shape))
    totals[0] = first
    for i, costs in enumerate(blocks):
        least = totals[i].min(axis=-2, keepdims=True) + price
        totals[i + 1] = np.minimum(totals[i], least) + costs
    return totals
