"""Whether the azimuth of the field agrees with a known heading, or with what a gyro tells."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from agonic.coverage import OPEN_DEG
from agonic.fit import Channel
from agonic.health import Finding, figure

HEADING_DOUBTFUL_DEG = 5.0
HEADING_REFUSED_DEG = 20.0


def check_azimuth(
    channels: Mapping[str, Channel], radius: float, inclination_deg: float, *, felt: bool = False
) -> Finding | None:
    """The finding that the azimuth of the calibrated field scatters by too much.

    Parameters: the size of the field in the unit of the readings, and its dip; `felt` where a gyro
    tells the azimuth and not a known heading.
    """
    if "azimuth" not in channels:
        return None
    level = max(radius * np.cos(np.radians(inclination_deg)), 1e-9)
    off = float(np.degrees(channels["azimuth"].noise / level))
    if off <= HEADING_DOUBTFUL_DEG:
        return None
    if felt:
        beside = "what the gyro tells: its unit, axes, sign or clock are wrong"
        move = "check unit, axes and times of the gyro"
    else:
        beside = "that of the known heading: it is wrong, late, or in radians"
        move = "check the heading, its unit and its zero, or fit without it (levelled)"
    spread = f"by {figure(off)}°" if off < OPEN_DEG else "over the whole circle"
    return Finding(
        "heading",
        "refuse" if off > HEADING_REFUSED_DEG else "check",
        f"the field's azimuth scatters {spread} about {beside}",
        move,
    )
