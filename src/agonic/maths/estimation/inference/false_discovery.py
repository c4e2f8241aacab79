"""False discovery rate: which of many tests say something, when so many are made at once."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Mask


def find_discoveries(p_values: Array, rate: float, tests: int | None = None) -> Mask:
    """Tests that hold with a false discovery rate of at most `rate` (Benjamini & Hochberg 1995).

    Of m p-values in order the first k hold, for the largest k with p₍k₎ ≤ rate·k/m; where there
    is nothing to find, any at all is found with a probability of at most `rate`. Inverse e-values
    may stand for p-values, and need no independence (Wang & Ramdas 2022).

    Parameters: p_values (m,), rate, and tests: m, where only the smallest p-values are given.

    >>> find_discoveries(np.array([0.001, 0.5, 0.02, 0.9]), 0.05).tolist()
    [True, False, True, False]
    """
    m = len(p_values) if tests is None else tests
    small = np.flatnonzero(p_values <= rate)
    order = small[np.argsort(p_values[small], kind="stable")]
    holds = p_values[order] <= rate * np.arange(1, len(order) + 1) / max(m, 1)
    k = int(np.flatnonzero(holds)[-1]) + 1 if holds.any() else 0
    found = np.zeros(len(p_values), dtype=bool)
    found[order[:k]] = True
    return found
