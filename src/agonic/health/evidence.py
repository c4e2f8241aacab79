"""What a magnitude fit leaves to be examined, and what of it is doubtful."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from agonic.arrays import Array
from agonic.coverage import Coverage
from agonic.maths.equation.crowding import weigh_places

HEADING_REFUSED_DEG = 10.0
HEADING_DOUBTFUL_DEG = 2.0
NOISE_DOUBTFUL = 0.04  # of the field's magnitude
OUTLIERS_DOUBTFUL = 0.1
SPARE = 3  # orientations beyond the unknowns that check them
RECORD_LONGER = "record longer"
"""The advice that goes with no cause."""
HALF_CIRCLE_DEG = 180.0
SHIFT_REFUSED = 0.04  # of the field's magnitude
SHIFT_DOUBTFUL = 0.01
SHIFT_OVER_NOISE = 3.0  # less than this does not stand out of the readings
MOST_ROWS = 20_000
"""Rows that are enough to tell of all."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """What a magnitude fit leaves to be examined, all in the unit of the readings.

    `readings` (n, 3), `time` (n,) or None, `residuals` (n,), `weights` (n,), `normals` (n, 3) the
    unit directions in which a residual is measured; `bias` and `radius` of the readings' ellipsoid
    and `shape` (3, 3) the matrix over its mean gain; `noise`; `known_radius` what the radius is at
    least, as far as that is known; `unknowns` those that the readings have to determine.
    """

    readings: Array
    time: Array | None
    residuals: Array
    weights: Array
    normals: Array
    bias: Array
    shape: Array
    radius: float
    noise: float
    coverage: Coverage
    known_radius: float | None = None
    unknowns: int = 9
    unit: str = "nT"

    @cached_property
    def crowding(self) -> Array:
        """Weights (n,) of the readings, less where many say the same."""
        return weigh_places(self.readings)
