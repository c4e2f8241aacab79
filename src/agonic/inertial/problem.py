"""From samples, reference and the attitude felt to what the estimator takes."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Index
from agonic.attitude.problem import Scale, normalise
from agonic.inertial.attitude import Inertial
from agonic.inertial.settings import Settings
from agonic.maths.equation.affine import FREE
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.inertial import Relative, Shared
from agonic.maths.rotations import tilt as kernel
from agonic.reference import Reference
from agonic.samples import Samples

FEWEST = 30
"""Rows of a stretch whose azimuth is an unknown of its own."""


def with_tilt(samples: Samples, felt: Inertial) -> Samples:
    """The samples with roll and pitch as they were felt, and no heading."""
    roll, pitch = kernel.roll_pitch_deg(kernel.tilt_from_down(felt.down))
    return samples.with_columns(roll_deg=roll, pitch_deg=pitch, heading_deg=None)


def pose(
    tilted: Samples, reference: Reference, felt: Inertial, settings: Settings, taken_out: Array
) -> tuple[Problem, Scale]:
    """The problem of the rows whose tilt is known, and its scale.

    Parameters: `taken_out` as of `Shared`.
    """
    gauge = FREE if settings.gauge == "auto" else settings.gauge
    problem, scale = normalise(tilted, reference, ("magnitude", "dip"), gauge, settings)
    relative = None
    if felt.ahead is not None:
        assert tilted.time is not None
        stretch = number_stretches(tilted.time, felt.part, settings.stretch_s)
        relative = Relative(felt.ahead, stretch)
    return problem._replace(shared=share(felt, settings, taken_out), relative=relative), scale


def share(felt: Inertial, settings: Settings, taken_out: Array) -> Shared:
    """What the errors of the inertial unit do, each in units of its standard deviation."""
    sds = standard_deviations(felt, settings)
    azimuth_by = np.zeros((len(felt.down), 3)) if felt.azimuth_by is None else felt.azimuth_by
    return Shared(-felt.down_by * sds, azimuth_by * sds, np.zeros(len(sds)), taken_out)


def standard_deviations(felt: Inertial, settings: Settings) -> Array:
    """Of the priors of the errors: of the accelerometer, of the gyro, and of the speed."""
    accelerometer = np.full(3, settings.accelerometer_sd_m_s2)
    if felt.azimuth_by is None:
        return accelerometer
    bias = np.radians(settings.gyro_bias_sd_deg_s)
    others = np.repeat([bias, settings.gyro_scale_sd, settings.speed_sd_m_s], 3)
    return np.concatenate([accelerometer, others])


def without_errors(samples: Samples, errors: Array) -> Samples:
    """The samples without errors of the inertial unit, as of `standard_deviations`."""
    force, rate = samples.acceleration, samples.rotation_rate
    assert force is not None
    if len(errors) == 3:
        return samples.with_columns(acceleration=force - errors)
    assert rate is not None
    rate = (rate - errors[3:6]) / (1.0 + errors[6:9])
    force = force - errors[:3] - np.cross(rate, errors[9:])
    return samples.with_columns(acceleration=force, rotation_rate=rate)


def number_stretches(time: Array, part: Index, stretch_s: float) -> Index:
    """The number of each row's stretch: parts without a pause, cut evenly.

    >>> minutes = number_stretches(np.arange(120.0), np.zeros(120, dtype=int), 60.0)
    >>> minutes[[0, 59, 60, 119]].tolist()
    [0, 0, 1, 1]
    """
    numbers, count = np.empty(len(time), dtype=np.intp), 0
    for one in np.unique(part):
        rows = np.flatnonzero(part == one)
        span = float(time[rows[-1]] - time[rows[0]])
        pieces = max(1, min(round(span / stretch_s), len(rows) // FEWEST))
        numbers[rows] = count + np.arange(len(rows)) * pieces // len(rows)
        count += pieces
    return numbers
