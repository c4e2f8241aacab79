"""`Attitude`: the tilt of the vehicle at each sample, and how well it is known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.calibration.setup import Setup
from agonic.maths.rotations import tilt as kernel

LEVEL = "level"
RECORDED_SD_DEG = 0.5
"""Of roll and pitch that an autopilot recorded, and of an accelerometer at rest, unless stated."""
UNSURE_DEG = 5.0
"""A tilt that is known no better has no heading to rely on: at a dip of 65° it is off by 10°."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Attitude:
    """The tilt, the order of its turns, where it came from, how well it is known, (n,) or (1,).

    `roll_sd`, `pitch_sd` in rad; `stated_sd`, rad, is what of them the setup states;
    `gyro_bias` (3,), rad/s in body axes, and its sd are what the gyro filter found, if there was
    one; `unsure` and `missing` mark rows; `notes` say why it came thence.
    """

    tilt: kernel.Tilt
    roll_deg: Array
    pitch_deg: Array
    source: str
    roll_sd: Array
    pitch_sd: Array
    order: kernel.Order = "roll-pitch"
    stated_sd: float = 0.0
    gyro_bias: Array | None = None
    gyro_bias_sd: float = 0.0
    missing: Mask | None = None
    notes: tuple[str, ...] = ()

    @cached_property
    def variance(self) -> Array:
        """The variance of the tilt about a level axis, the mean of both, rad²."""
        upright = self.tilt.cos_pitch if self.order == "roll-pitch" else 1.0
        return np.asarray(((self.roll_sd * upright) ** 2 + self.pitch_sd**2) / 2)

    @cached_property
    def sd_deg(self) -> Array:
        """The standard deviation of the tilt about a level axis."""
        return np.asarray(np.degrees(np.sqrt(self.variance)))

    @property
    def unsure(self) -> Mask:
        """The rows whose tilt is not known to `UNSURE_DEG`."""
        return np.asarray(self.sd_deg > UNSURE_DEG)

    @property
    def down(self) -> Array:
        """Down in body axes, (n, 3) or (1, 3)."""
        return kernel.compute_down(self.tilt, self.order)

    def select_tilt(self, rows: slice | Index) -> kernel.Tilt:
        """The tilt of some rows."""
        return kernel.Tilt(*(select_rows(part, rows) for part in self.tilt))

    def with_own(self, tilt: Array | None) -> Attitude:
        """The attitude by roll and pitch (n, 2), degrees, of a sensor's own inclinometer, where it
        has one and the tilt is from the log."""
        if tilt is None or self.source != "log":
            return self
        roll, pitch = tilt.T
        own = kernel.tilt_from_angles(roll, pitch)
        return replace(self, tilt=own, roll_deg=roll, pitch_deg=pitch)


def select_rows(values: Array, rows: slice | Index) -> Array:
    """The rows of a column, or the one value that holds for all."""
    return values if len(values) == 1 else values[rows]


def find_stated_sd(setup: Setup, otherwise_deg: float = RECORDED_SD_DEG) -> float:
    """The sd of roll and pitch that the setup states, or that of such a source, rad."""
    return float(np.radians(otherwise_deg if setup.tilt_sd_deg is None else setup.tilt_sd_deg))
