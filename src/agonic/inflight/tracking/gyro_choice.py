"""Whether a gyro is used, and the magnitudes beside it."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.errors import AgonicError
from agonic.health.turning import FEWEST, check_turning, explains_change
from agonic.reference import Reference
from agonic.samples import Samples

STEADY = 0.05
"""Of the magnitude: where it changes by more, its direction changes too, and no gyro sees that."""


def choose_gyro(samples: Samples, magnitude: Array, wanted: bool | None) -> tuple[bool, str]:
    """Whether to use the gyro of the samples, and why not where it is left aside.

    Raises `AgonicError` where it is wanted and is not there, or does not turn as the magnetometer.
    """
    if wanted is False:
        return False, ""
    if samples.rotation_rate is None or samples.time is None:
        if wanted:
            raise AgonicError("a gyro was asked for and the samples hold no rotation_rate")
        return False, ""
    mistake = check_turning(samples)
    if mistake is not None:
        if wanted:
            raise AgonicError(f"{mistake.what}; {mistake.move}, or leave the gyro out")
        return False, mistake.what
    known = magnitude[magnitude > 0]
    if wanted or not len(known):
        return True, ""
    if np.ptp(known) > STEADY * float(np.mean(known)):
        return False, "the field itself changes on the way, which no gyro sees"
    if len(samples) >= FEWEST and explains_change(samples):
        return True, ""
    return False, "the gyro explains less than half of how the readings change"


def find_magnitudes(samples: Samples, reference: Reference | None) -> Array:
    """The magnitude at each reading, (n,), nT; 0 where none is known."""
    if reference is None:
        return np.zeros(len(samples))
    return np.broadcast_to(reference.magnitudes(len(samples)), len(samples))
