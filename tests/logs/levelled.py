"""The heading that a levelled compass shows, to hold against a logged attitude."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agonic.maths.equation.affine import correct
from agonic.samples import Samples


def heading_error_deg(s: Samples, declination_deg: float = 0.0) -> NDArray[np.float64]:
    """Compass heading of the logged correction, plus declination, less the logged heading."""
    assert s.logged is not None
    assert s.roll_deg is not None
    assert s.pitch_deg is not None
    x, y, z = correct(s.field, s.logged.bias, s.logged.matrix).T
    roll, pitch = np.radians(s.roll_deg), np.radians(s.pitch_deg)
    down = y * np.sin(roll) + z * np.cos(roll)
    north = x * np.cos(pitch) + down * np.sin(pitch)
    east = y * np.cos(roll) - z * np.sin(roll)
    heading = np.degrees(np.arctan2(-east, north)) + declination_deg
    return np.asarray((heading - s.heading_deg + 180.0) % 360.0 - 180.0)
