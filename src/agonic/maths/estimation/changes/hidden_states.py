"""The likeliest path through hidden states, where each switch has a price (Viterbi 1967)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array


def find_path(cost: Array, price: float) -> NDArray[np.int8]:
    """The states (n,) that make the sum of costs and prices least.

        Σ cost[s_i, i] + price · #(s_i ≠ s_{i−1})

    Parameters: `cost` (k, n), minus the logarithm of the likelihood of row i in state s.

    >>> cost = np.repeat([[0.0, 1.0, 0.0], [1.0, 0.0, 1.0]], [5, 9, 1], axis=1)
    >>> find_path(cost, 3.0).tolist()
    [0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1]
    """
    total = [0.0] * len(cost)
    bests, switched = [], []  # of each row: the state to switch from, and which states do
    for costs in cost.T.tolist():
        least = min(total)
        best, least = total.index(least), least + price
        bests.append(best)
        switched.append([before > least for before in total])
        total = [
            (least if before > least else before) + more
            for before, more in zip(total, costs, strict=True)
        ]
    state, s = [0] * len(bests), total.index(min(total))
    for row in range(len(bests) - 1, -1, -1):
        state[row] = s
        if switched[row][s]:
            s = bests[row]
    return np.array(state, dtype=np.int8)
