"""`LiveParams` and `LiveState`: what a live calibration is to reach, and where it stands."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.errors import AgonicError
from agonic.live.maths.voxels import Voxels
from agonic.live.track import Track
from agonic.reference import Reference
from agonic.units import find_unit


@dataclass(frozen=True, kw_only=True, eq=False)
class LiveParams:
    """What a live calibration is told before the first reading.

    Parameters
    ----------
    unit : of the readings, "nT", "uT", "mG", "G" … or "raw".
    magnitude : of the field at the place, nT; `None` where it is not known.
    field_n : the field of the place, nT, north, east and down; `None` where it is not known. It is
        what accelerometer and gyro are of use with. It tells `magnitude` and `inclination_deg`.
    magnitude_sd : its standard error, nT. source : where it is from, in words.
    inclination_deg : dip of the field, for the standard error of a level heading.
    target_deg : the standard error of the heading that is enough, degrees.
    soft_iron_sd : standard deviation of the prior on soft iron.
    every : readings between two fits.
    name : of the sensor. device_id : the number by which an autopilot knows it.

    Examples
    --------
    >>> LiveParams(magnitude=50_000.0).target_deg
    0.5
    """

    unit: str = "nT"
    magnitude: float | None = None
    field_n: tuple[float, float, float] | None = None
    magnitude_sd: float = 0.0
    source: str = "given"
    inclination_deg: float = 60.0
    target_deg: float = 0.5
    soft_iron_sd: float = 0.1
    every: int = 10
    name: str = "mag"
    device_id: int | None = None

    def __post_init__(self) -> None:
        find_unit(self.unit)
        for name in ("target_deg", "soft_iron_sd", "every"):
            if not getattr(self, name) > 0:
                raise AgonicError(f"{name} is {getattr(self, name)}; it must be above zero")
        if self.field_n is not None:
            north, east, down = self.field_n
            dip = np.degrees(np.arctan2(down, np.hypot(north, east)))
            object.__setattr__(self, "magnitude", float(np.linalg.norm(self.field_n)))
            object.__setattr__(self, "inclination_deg", float(dip))
        if self.magnitude is not None and not self.magnitude > 0:
            raise AgonicError(
                f"a magnitude of {self.magnitude} nT is not possible; leave it out if unknown"
            )

    @property
    def reference(self) -> Reference | None:
        """The field of the place, or its magnitude, as a reference; `None` where not known."""
        sd, source = self.magnitude_sd, self.source
        if self.field_n is not None:
            return Reference.vector(self.field_n, frame="n", sd=sd, source=source)
        if self.magnitude is None:
            return None
        return Reference.constant(self.magnitude, sd=sd, source=source)


OF_FIT = ("bias", "matrix", "covariance", "noise", "condition")
"""What every fit by moments or to points has under these names."""


class Found(NamedTuple):
    """The last fit: centre and size of the points it was made on, and what came out there. reading
    = centre + size · point; `covariance` (9, 9) of bias and matrix to magnitude one; `left_out`
    readings were too far from all others to count."""

    n: int
    centre: Array
    size: float
    bias: Array
    matrix: Array
    covariance: Array
    noise: float
    condition: float
    left_out: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class LiveState:
    """Where a live calibration stands; of bounded size, whatever has been seen.

    `n` readings seen, and `rejected` ones that no sensor gives; `voxels` those that were let in;
    `found` the fit to them and to what waits; `kept` (m, 4) the rows of time and field to make the
    final calibration of: the first of every box, and ever fewer of the later ones; `recent` (j, 4)
    the last rows; `repeats` (3,) how often in a row each axis has said the same.

    `waiting` (k, 4) are the rows not let in yet, for iron that comes near is noticed only when it
    is; `judge` the fit that they are held against, made when `judged_at` readings were seen;
    `alarm` the time, s, of the last that were off it, by `off` of the magnitude, and `held` how
    many were kept out.

    `track` is the way the sensor went, where an accelerometer came with the readings.
    """

    n: int = 0
    rejected: int = 0
    voxels: Voxels | None = None
    found: Found | None = None
    kept: Array = field(default_factory=lambda: np.empty((0, 4)))
    recent: Array = field(default_factory=lambda: np.empty((0, 4)))
    repeats: Array = field(default_factory=lambda: np.zeros(3))
    waiting: Array = field(default_factory=lambda: np.empty((0, 4)))
    judge: Found | None = None
    judged_at: int = 0
    alarm: float = -np.inf
    off: float = 0.0
    held: int = 0
    track: Track | None = None
