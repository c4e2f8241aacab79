"""Angles between vectors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def angle_deg(a: Array, b: Array) -> Array:
    """The angle between vectors (…, 3), degrees; exact for small angles (Kahan's formula).

    >>> float(angle_deg(np.array([1.0, 0, 0]), np.array([0.0, 2.0, 0])))
    90.0
    """
    a_long = a * np.linalg.norm(b, axis=-1, keepdims=True)
    b_long = b * np.linalg.norm(a, axis=-1, keepdims=True)
    half = np.arctan2(
        np.linalg.norm(a_long - b_long, axis=-1), np.linalg.norm(a_long + b_long, axis=-1)
    )
    return np.asarray(np.degrees(2 * half))
