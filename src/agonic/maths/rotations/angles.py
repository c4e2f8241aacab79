"""Angles: between vectors, and brought to −180…180."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.maths.one_pass import find_length


def wrap_deg(angle_deg: ArrayLike) -> Array:
    """Angles brought to −180…180, 180 itself left out."""
    return np.asarray((np.asarray(angle_deg, dtype=np.float64) + 180.0) % 360.0 - 180.0)


def angle_deg(a: Array, b: Array) -> Array:
    """The angle between vectors (…, 3), degrees; exact for small angles (Kahan's formula)."""
    a_long, b_long = a * find_length(b)[..., None], b * find_length(a)[..., None]
    half = np.arctan2(find_length(a_long - b_long), find_length(a_long + b_long))
    return np.asarray(np.degrees(2 * half))
