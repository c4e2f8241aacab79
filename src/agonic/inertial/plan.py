"""What a further drive would tell: the heading's standard error after it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.arrays import Array
from agonic.attitude.known_heading import compute_mounted_heading
from agonic.errors import CoverageError
from agonic.inertial.fit import InertialFit, fit_inertial
from agonic.maths.equation.coverage import make_level_axes
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.units import STANDARD_GRAVITY_M_S2

PAUSE_S = 10.0
"""Between the readings so far and the drive."""
RATE_HZ = 6.0
TILTS_S = 3.0
"""In which a vehicle comes from one slope to another."""


class Drive(NamedTuple):
    """Attitudes of a vehicle, (m,) each, degrees, `RATE_HZ` a second: heading from magnetic north,
    nose up, right side down."""

    heading_deg: Array
    pitch_deg: Array
    roll_deg: Array


def predict_heading_sd(
    fit: InertialFit, past: Samples, reference: Reference, drive: Drive, down: Array
) -> float:
    """The standard error, degrees, of a level heading by a fit that has a drive's readings too. The
    readings that the drive would give by the present fit, with the noise and the errors of the unit
    that it found, are fitted together with those of the past. So the prediction knows all that the
    fit itself knows of its errors."""
    joined = _join(past, _simulate(fit, past, reference, drive, down))
    try:
        return compute_own_heading_sd(fit_inertial(joined, reference))
    except CoverageError:
        return np.inf


def compute_own_heading_sd(fit: InertialFit) -> float:
    """The standard error of a level heading of the sensor's own axes, degrees."""
    return compute_mounted_heading(fit.calibration, fit.coverage).own_sd_deg


def _simulate(
    fit: InertialFit, past: Samples, reference: Reference, drive: Drive, down: Array
) -> Samples:
    """The readings along a drive, in time after those of the past."""
    assert past.time is not None
    rng = np.random.default_rng(0)
    angles = _smooth(np.stack([drive.heading_deg, drive.pitch_deg, drive.roll_deg], axis=1))
    turned = Rotation.from_euler("ZYX", angles, degrees=True)
    to_sensor = make_level_axes(down)  # v @ it, of rows v in axes forward, right, down
    horizontal, vertical = reference.horizontal_and_vertical(1)[0]
    noise = rng.standard_normal((3, len(angles), 3))
    field = turned.inv().apply([horizontal, 0.0, vertical]) @ to_sensor
    raw = field @ np.linalg.inv(fit.calibration.matrix).T + fit.calibration.bias
    force = turned.inv().apply([0.0, 0.0, -STANDARD_GRAVITY_M_S2]) @ to_sensor
    force = force + fit.accelerometer_bias + fit.felt.force_sd * noise[1]
    rate = None
    if fit.gyro_bias is not None and past.rotation_rate is not None:
        steps = (turned[:-1].inv() * turned[1:]).as_rotvec() * RATE_HZ
        rate = (
            np.pad(steps, ((1, 0), (0, 0)), "edge") + np.pad(steps, ((0, 1), (0, 0)), "edge")
        ) / 2
        rate = rate @ to_sensor
        force = force + np.cross(rate, fit.inertial_errors[9:12])  # a speed kept in turns
        rate = rate * (1.0 + fit.inertial_errors[6:9]) + fit.gyro_bias + fit.felt.rate_sd * noise[2]
    return Samples(
        time=past.time[-1] + PAUSE_S + np.arange(len(angles)) / RATE_HZ,
        field=raw + fit.noise * noise[0],
        acceleration=force,
        rotation_rate=rate,
        unit=past.unit,
        name=past.name,
    )


def _smooth(angles: Array) -> Array:
    """Angles (m, 3) of a vehicle that takes `TILTS_S` to change its slope."""
    half = round(TILTS_S * RATE_HZ / 2)
    sums = np.cumsum(np.pad(angles, ((half + 1, half), (0, 0)), "edge"), axis=0)
    return np.asarray(sums[2 * half + 1 :] - sums[: len(angles)]) / (2 * half + 1)


def _join(past: Samples, drive: Samples) -> Samples:
    """Both, one after the other."""

    def both(name: str) -> Array | None:
        first, second = getattr(past, name), getattr(drive, name)
        return None if first is None or second is None else np.concatenate([first, second])

    columns: dict[str, Any] = {
        name: both(name) for name in ("time", "field", "acceleration", "rotation_rate")
    }
    return Samples(**columns, unit=past.unit, name=past.name)
