"""Whether the axes of the readings are those of roll and pitch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agonic.health.finding import Finding
from agonic.kernels.mounting import in_words, right_angles, vertical_misfit

Array = NDArray[np.float64]

FAR_BETTER = 0.4
"""Another mounting is believed when it leaves less than this share of the vertical's misfit."""


def mounted(readings: Array, down: Array) -> Finding | None:
    """The finding that the sensor sits in the vehicle by another right angle than its axes say.

    Parameters: readings (n, 3) and the direction of down in body axes (n, 3).
    """
    turns = right_angles()
    misfit = vertical_misfit(readings, down, turns)
    best = int(np.argmin(misfit))
    if misfit[best] >= FAR_BETTER * misfit[0]:
        return None
    return Finding(
        "mounting",
        "refuse",
        "the readings do not follow roll and pitch along the axes they are named for; they would "
        f"with the sensor mounted so that {in_words(turns[best])}",
        "turn the readings into body axes, or correct the orientation set for this sensor",
    )
