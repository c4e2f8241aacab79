"""What gravity says of the axes of a fit by the magnitude alone."""

from __future__ import annotations

import numpy as np

from agonic.fit import Fit
from agonic.health import check_axes
from agonic.reference import Reference
from agonic.samples import Samples


def check_by_gravity(fit: Fit, samples: Samples, reference: Reference | None) -> Fit:
    """The fit, with a finding where its axes are not those of the accelerometer in the same rows.

    Magnitude cannot see exchanged axes. Parameters: the fit of these samples and its reference,
    whose vertical part, where it is known, tells up from down.
    """
    if samples.acceleration is None or fit.verdict == "refused":
        return fit
    used = slice(None) if fit.weights is None else fit.weights > 0
    calibration = fit.calibration
    assert calibration.magnitude is not None
    found = check_axes(
        calibration.correct(samples.field[used]),
        samples.acceleration[used],
        calibration.magnitude,
        _upwards(reference),
    )
    return fit if found is None else fit.with_findings(found)


def _upwards(reference: Reference | None) -> bool | None:
    """Whether the field points up, where the reference knows."""
    if reference is None or reference.kind not in ("vector", "horizontal-vertical"):
        return None
    if reference.kind == "vector" and reference.frame != "n":
        return None
    return bool(np.mean(reference.horizontal_and_vertical(len(reference.values))[:, 1]) < 0)
