"""Angles: between vectors, and brought to −180…180."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array


def wrap_deg(angle_deg: ArrayLike) -> Array:
    """Angles brought to −180…180, 180 itself left out.

    >>> wrap_deg([350.0, -190.0, 10.0]).tolist()
    [-10.0, 170.0, 10.0]
    """
    return np.asarray((np.asarray(angle_deg, dtype=np.float64) + 180.0) % 360.0 - 180.0)


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
