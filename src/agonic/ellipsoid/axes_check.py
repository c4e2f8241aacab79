"""What gravity says of the axes of a fit that the magnitude alone taught."""

from __future__ import annotations

import numpy as np

from agonic.ellipsoid.calibration import finished
from agonic.fit import Fit
from agonic.health import check_axes
from agonic.reference import Reference
from agonic.samples import Samples


def against_gravity(fit: Fit, samples: Samples, reference: Reference | None) -> Fit:
    """The fit, told where its axes are not those of the accelerometer in the same rows.

    Magnitude cannot see exchanged axes. Parameters: the fit of these samples and its reference,
    whose vertical part, where it is known, tells up from down.
    """
    if samples.acceleration is None or fit.verdict == "refused":
        return fit
    believed = slice(None) if fit.weights is None else fit.weights > 0
    calibration = fit.calibration
    assert calibration.magnitude is not None
    told = check_axes(
        calibration.correct(samples.field[believed]),
        samples.acceleration[believed],
        calibration.magnitude,
        _upwards(reference),
    )
    return fit if told is None else finished(fit, (told,))


def _upwards(reference: Reference | None) -> bool | None:
    """Whether the field points up, where the reference knows."""
    if reference is None or reference.kind not in ("vector", "horizontal-vertical"):
        return None
    if reference.kind == "vector" and reference.frame != "n":
        return None
    return bool(np.mean(reference.horizontal_and_vertical(len(reference.values))[:, 1]) < 0)
