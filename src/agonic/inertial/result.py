"""`InertialFit`: a calibration with the errors of the accelerometer and gyro that taught it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agonic.arrays import Array, Index
from agonic.fit import Fit
from agonic.inertial.attitude import Inertial
from agonic.inertial.problem import Settings
from agonic.inertial.start import Solved
from agonic.reference import Reference
from agonic.samples import Samples


@dataclass(frozen=True, kw_only=True, eq=False)
class InertialFit(Fit):
    """A calibration beside accelerometer and gyro, and what was found of these.

    `samples` are those that were fitted, with roll and pitch as they were felt, and `reference`
    theirs; `felt` is that attitude, with the errors found taken out, but level as the accelerometer
    reads it where the vehicle stays near level: so calibration and tilt go together afterwards.
    `inertial_errors` (q,) and their `inertial_sd`: the accelerometer's bias, m/s², and with a gyro
    its bias, rad/s, its scale, the speed, m/s, that the vehicle keeps in turns, and how late, s,
    beside the gyro the readings are beyond what was undone, and the acceleration; where the dip is
    an unknown it is the last, rad. `accelerometer_gain` (3, 3) is what the accelerometer reads over
    what it feels, where there is a gyro. `heading_source` is what told the headings that
    joined, and `solved` the estimate by which parts of the rows are fitted.
    """

    samples: Samples
    reference: Reference
    felt: Inertial
    inertial_errors: Array
    inertial_sd: Array
    accelerometer_gain: Array | None
    settings: Settings
    solved: Solved
    heading_source: str | None = None

    @property
    def accelerometer_bias(self) -> Array:
        """What the accelerometer reads too much, (3,) m/s²."""
        return self.inertial_errors[:3]

    @property
    def gyro_bias(self) -> Array | None:
        """What the gyro reads too much, (3,) rad/s; `None` without one."""
        return None if self.felt.ahead is None else self.inertial_errors[3:6]

    @property
    def source(self) -> str:
        """What told the attitude."""
        unit = "accelerometer" if self.felt.ahead is None else "accelerometer and gyro"
        return unit if self.heading_source is None else f"{unit}, and {self.heading_source}"

    def find_rows(self, samples: Samples) -> Index | None:
        """The rows of the fit that some of its samples are; `None` where they are others."""
        if self.samples.time is None or samples.time is None:
            return None
        rows = np.searchsorted(self.samples.time, samples.time)
        rows = np.minimum(rows, len(self.samples) - 1)
        return rows if np.array_equal(self.samples.time[rows], samples.time) else None
