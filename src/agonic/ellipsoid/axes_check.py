"""What gravity says of the axes of a fit by the magnitude alone."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.fit import Fit
from agonic.health import check_axes
from agonic.maths.rotations.attitude import down_b
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.units import STANDARD_GRAVITY_M_S2


def check_by_gravity(fit: Fit, samples: Samples, reference: Reference | None) -> Fit:
    """The fit, with a finding where its axes are not those of the accelerometer in the same rows.

    Magnitude cannot see exchanged or reversed axes. Without an accelerometer roll and pitch tell
    where gravity was. Parameters: the fit of these samples and its reference, whose vertical part,
    where it is known, tells up from down.
    """
    beside, force = _find_force(samples)
    if force is None or fit.verdict == "refused":
        return fit
    used = slice(None) if fit.weights is None else fit.weights > 0
    calibration = fit.calibration
    assert calibration.magnitude is not None
    found = check_axes(
        calibration.correct(samples.field[used]),
        force[used],
        calibration.magnitude,
        _upwards(reference),
        beside,
    )
    return fit if found is None else fit.with_findings(found)


def _find_force(samples: Samples) -> tuple[str, Array | None]:
    """What tells where gravity was, and the specific force (n, 3) by it."""
    if samples.acceleration is not None or samples.roll_deg is None or samples.pitch_deg is None:
        return "the accelerometer beside it", samples.acceleration
    down = down_b(samples.roll_deg, samples.pitch_deg)
    return "roll and pitch", -STANDARD_GRAVITY_M_S2 * down


def _upwards(reference: Reference | None) -> bool | None:
    """Whether the field points up, where the reference knows."""
    if reference is None or reference.kind not in ("vector", "horizontal-vertical"):
        return None
    if reference.kind == "vector" and reference.frame != "n":
        return None
    return bool(np.mean(reference.horizontal_and_vertical(len(reference.values))[:, 1]) < 0)
