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
    k, n = cost.shape
    total = [0.0] * k
    came = np.empty((n, k), dtype=np.int8)
    for row, costs in enumerate(cost.T.tolist()):
        best = min(range(k), key=total.__getitem__)
        switched = total[best] + price
        came[row] = [s if total[s] <= switched else best for s in range(k)]
        total = [min(total[s], switched) + costs[s] for s in range(k)]
    state = np.empty(n, dtype=np.int8)
    s = int(np.argmin(total))
    for row in range(n - 1, -1, -1):
        state[row] = s
        s = int(came[row, s])
    return state
