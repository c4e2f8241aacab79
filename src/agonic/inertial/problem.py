"""From samples, reference and the attitude felt to what the estimator takes."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from agonic.arrays import Array, Index
from agonic.attitude.problem import Scale, normalise
from agonic.attitude.problem import Settings as AttitudeSettings
from agonic.calibration.setup import LATENCY_SD_S
from agonic.errors import AgonicError
from agonic.inertial.attitude import UNKNOWNS, Inertial, find_parts
from agonic.maths.equation.affine import FREE, correct, split
from agonic.maths.equation.channels import Problem, field_of_terms
from agonic.maths.equation.inertial import Relative, Shared
from agonic.maths.rotations import tilt as kernel
from agonic.reference import Reference
from agonic.samples import Samples

INCLINATION_SD = 0.5
"""Prior of a dip that is not known, rad, about the one that was found first."""
ACCELERATION_DELAY_SD_S = 0.05
"""Prior of how late the accelerometer is beside the gyro: mostly both are of one chip, but a log
may hold one filtered, or of another clock."""


@dataclass(frozen=True, kw_only=True)
class Settings(AttitudeSettings):
    """The settings of a fit; see `fit_inertial`."""

    accelerometer_sd_m_s2: float = 0.1
    gyro_bias_sd_deg_s: float = 1.0
    gyro_scale_sd: float = 0.02
    speed_sd_m_s: float = 10.0
    stretch_s: float = 30.0
    heading_offset_sd_deg: float = 1.0
    accelerometer_scale_sd: float | None = None
    inclination_sd: float = 0.0
    delay_sd_s: float = LATENCY_SD_S
    acceleration_delay_sd_s: float = ACCELERATION_DELAY_SD_S

    def __post_init__(self) -> None:
        super().__post_init__()
        for one in fields(self)[len(fields(AttitudeSettings)) :]:
            value = getattr(self, one.name)
            if value is not None and not value > 0 and one.name != "inclination_sd":
                raise AgonicError(f"{one.name} is {value}; it has to be above zero")

    @property
    def inclination_free(self) -> bool:
        """Whether nothing tells the dip."""
        return self.inclination_sd >= INCLINATION_SD


NODDING_S = 1.0
"""Time constant of the turns that change the course of a vehicle: in a gust it only nods."""
AZIMUTH_S = 10.0
"""Over which the azimuth of the field is smoothed where the joint estimate starts."""
MIN_STRETCH_ROWS = 30
"""Rows of a stretch whose azimuth is an unknown of its own."""


def with_tilt(samples: Samples, felt: Inertial) -> Samples:
    """The samples with roll and pitch as they were felt."""
    roll, pitch = kernel.roll_pitch_deg(kernel.tilt_from_down(felt.down))
    return samples.with_columns(roll_deg=roll, pitch_deg=pitch)


def pose(
    tilted: Samples, reference: Reference, felt: Inertial, settings: Settings, taken_out: Array
) -> tuple[Problem, Scale]:
    """The problem of the rows whose tilt is known, and its scale."""
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
    unit = azimuth_by.shape[1]
    down_by, dip_by = -felt.down_by * sds[:unit], np.zeros(len(sds))
    azimuth_by = azimuth_by * sds[:unit]
    if settings.inclination_sd:
        dip_by[-1] = sds[-1]
        down_by = np.pad(down_by, ((0, 0), (0, 0), (0, 1)))
        azimuth_by = np.pad(azimuth_by, ((0, 0), (0, 1)))
    kept = taken_out.copy()
    kept[12 : UNKNOWNS - 1] = 0.0  # a delay of the readings stays
    return Shared.of(down_by, azimuth_by, dip_by, kept)


def standard_deviations(felt: Inertial, settings: Settings) -> Array:
    """Of the priors of the errors: of the accelerometer, of the gyro, of the speed and of the
    delays; and of the dip, rad, where it is not known exactly."""
    sds, alone = [settings.accelerometer_sd_m_s2], []
    if felt.azimuth_by is not None:
        bias = float(np.radians(settings.gyro_bias_sd_deg_s))
        sds += [bias, settings.gyro_scale_sd, settings.speed_sd_m_s]
        alone = [settings.delay_sd_s, settings.acceleration_delay_sd_s]
    if settings.inclination_sd:
        alone += [settings.inclination_sd]
    return np.append(np.repeat(sds, 3), alone)


def without_errors(samples: Samples, errors: Array) -> Samples:
    """The samples without errors of the inertial unit, as of `standard_deviations`."""
    force, rate = samples.acceleration, samples.rotation_rate
    assert force is not None
    if len(errors) < 12 or rate is None:
        return samples.with_columns(acceleration=force - errors[:3])
    rate = (rate - errors[3:6]) / (1.0 + errors[6:9])
    force = force - errors[:3] - np.cross(rate, errors[9:12])
    force = force - np.cross(errors[13] * rate, force)
    return samples.with_columns(acceleration=force, rotation_rate=rate)


def orient(problem: Problem, samples: Samples, felt: Inertial, params: Array) -> Array:
    """Attitudes (n, 3, 3) to magnetic north, east and down: the azimuth of the field, smoothed."""
    from scipy.ndimage import uniform_filter1d  # slow to load

    assert samples.time is not None
    assert felt.ahead is not None
    bias, matrix = split(problem.basis @ params[: problem.basis.shape[1]])
    field = correct(problem.points - field_of_terms(problem, params), bias, matrix)
    aside = np.cross(felt.down, felt.ahead)
    azimuth = (field * felt.ahead).sum(axis=1) + 1j * (field * aside).sum(axis=1)
    steady = np.empty_like(azimuth)
    for rows in find_parts(samples.time):
        width = int(
            min(AZIMUTH_S / max(float(np.median(np.diff(samples.time[rows]))), 1e-9), len(rows))
        )
        steady[rows] = uniform_filter1d(azimuth[rows], max(width, 1), mode="nearest")
    steady /= np.maximum(np.abs(steady), 1e-300)
    north = steady.real[:, None] * felt.ahead + steady.imag[:, None] * aside
    return np.stack([north, np.cross(felt.down, north), felt.down], axis=1)


def number_stretches(time: Array, part: Index, stretch_s: float) -> Index:
    """The number of each row's stretch: parts without a pause, cut evenly."""
    numbers, count = np.empty(len(time), dtype=np.intp), 0
    for one in np.unique(part):
        rows = np.flatnonzero(part == one)
        span = float(time[rows[-1]] - time[rows[0]])
        pieces = max(1, min(round(span / stretch_s), len(rows) // MIN_STRETCH_ROWS))
        numbers[rows] = count + np.arange(len(rows)) * pieces // len(rows)
        count += pieces
    return numbers
