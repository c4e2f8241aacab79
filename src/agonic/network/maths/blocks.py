"""Blocks of time, for cross-validation and for what is held out of a training."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Index, Mask

BLOCKS = 20


def number_blocks(n: int, count: int = BLOCKS) -> Index:
    """The number of the block of time that each of n rows in order is in, (n,)."""
    return np.asarray(np.arange(n) * count // max(n, 1), dtype=np.intp)


def hold_out(n: int) -> Mask:
    """The rows (n,) that are not trained on: every fifth block of time.

    >>> hold_out(20).astype(int).tolist()
    [0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0]
    """
    return np.asarray(number_blocks(n) % 5 == 2)
