"""What a fit beside accelerometer and gyro rests on where the field of the place is not known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from agonic.ellipsoid.calibration import describe_missing_scale
from agonic.fit import Fit
from agonic.health import Finding, figure
from agonic.inertial.start import Solved

INCLINATION_DOUBTFUL_DEG = 3.0


def check_inclination(solved: Solved) -> Finding | None:
    """The finding that the log does not tell the dip that nothing else told."""
    if not solved.settings.inclination_free:
        return None
    variance = float(solved.found.solution.covariance[-1, -1])
    sd = float(np.degrees(np.sqrt(variance) * solved.sds[-1]))
    if sd < INCLINATION_DOUBTFUL_DEG:
        return None
    return Finding(
        "inclination",
        "check",
        f"the dip of the field is not known and the log tells it to {figure(sd)}° only: headings "
        "hold where the vehicle is as level as it was",
        "give the place (--at LAT,LON), or tilt the vehicle by 5° and more while it turns",
    )


def without_scale(fit: Fit, unit: str) -> Fit:
    """The fit where no magnitude was given: its field is in the unit of the readings."""
    magnitude = fit.calibration.magnitude
    assert magnitude is not None
    calibration = replace(fit.calibration, unit_out=unit)
    remarks = (*fit.remarks, describe_missing_scale(magnitude, unit))
    return replace(fit, calibration=calibration, remarks=remarks)
