"""The rates of a gyro in body axes, and whether they are what the compass turns by."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.calibration.base import Calibration, correct_field, has_two_axes
from agonic.calibration.setup import Setup
from agonic.errors import LogError
from agonic.headings.tilt_source import find_mounting
from agonic.health.inertial_unit import find_faults
from agonic.samples import Samples


def find_rate_mounting(samples: Samples, setup: Setup, calibration: Calibration) -> Array:
    """The turn (3, 3) from the axes of the rates to those of the body."""
    if setup.accelerometer is not None and samples.acceleration is not None:
        left, _, right = np.linalg.svd(setup.accelerometer.matrix)
        return np.asarray(left @ right)
    return find_mounting(calibration)


def find_wrong_gyro(samples: Samples, setup: Setup, calibration: Calibration) -> str | None:
    """What a gyro looks like that does not turn as the calibrated field does, or `None`.

    Raises LogError where the setup takes the tilt from it.
    """
    if samples.time is None or samples.rotation_rate is None or has_two_axes(calibration):
        return None
    turn = find_rate_mounting(samples, setup, calibration)
    field, rate = correct_field(calibration, samples), samples.rotation_rate @ turn.T
    there = Samples(time=samples.time, field=field, rotation_rate=rate)
    found = [one.finding for one in find_faults(there) if one.finding.severity == "refuse"]
    if not found:
        return None
    if setup.tilt == "gyro":
        raise LogError(found[0].sentence)
    return f"{found[0].what}; it was left out; {found[0].move}"
