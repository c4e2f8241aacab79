"""Vectors between their times; medians and lengths in a third of the time that NumPy's take.

`np.median` parts an array at three places, one of them to look for NaN; `np.linalg.norm` runs an
inner loop over each short row.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array


def median(values: ArrayLike) -> float:
    """The median of all values, to the last bit as by `np.median`; NaN where one is, or of none."""
    n = np.size(values)
    if n == 0:
        return float("nan")
    parted = np.partition(values, n // 2, axis=None)
    middle, most = parted[n // 2], parted[n // 2 :].max()  # NaN sorts behind all numbers
    if n % 2 == 0:
        middle = (parted[: n // 2].max() + middle) / 2
    return float("nan") if np.isnan(most) else float(middle)


def find_length(vectors: Array) -> Array:
    """The length of each of vectors (…, k)."""
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", vectors, vectors)))


def interpolate(wanted: Array, time: Array, values: Array) -> Array:
    """Values (n,) or (n, k) at wanted times (m,), linear between their own (n,)."""
    if values.ndim == 1:
        return np.interp(wanted, time, values)
    return np.stack([np.interp(wanted, time, axis) for axis in values.T], axis=1)
