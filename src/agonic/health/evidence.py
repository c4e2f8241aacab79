"""What a magnitude fit leaves to be examined, and what of it is doubtful."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from agonic.arrays import Array
from agonic.coverage import Coverage
from agonic.maths.equation.coverage import measure_thickness
from agonic.maths.equation.crowding import choose_evenly, choose_spread_rows, weigh_places

HEADING_REFUSED_DEG = 10.0
"""Of a level heading, one standard error: what is known no better is no compass."""
HEADING_DOUBTFUL_DEG = 2.0
"""The same: what a skipper or an autopilot notices."""
NOISE_DOUBTFUL = 0.04
"""Of the field, scatter about the best calibration: the field was not the same everywhere."""
FITTING_NOISE = 0.03
"""Noise over the field below which a fit holds for most of the readings."""
OUTLIERS_DOUBTFUL = 0.25
"""Of the rows left out: a robust fit is right beside fewer (torture: 20 % gross, a magnet that
passes), and half are no majority."""
OUTLIERS_TELLING = 0.05
"""From so many on two biases or two sensors may make them."""
SPARE = 3
"""Orientations beyond the unknowns that check them."""
RECORD_LONGER = "record longer"
"""The advice that goes with no cause."""
SHIFT_REFUSED = 0.04
"""Of the field, a step of the bias: no calibration holds for both sides within 2° of heading."""
SHIFT_DOUBTFUL = 0.03
"""The same, to be looked at: the whole step errs a level heading by 2° at a dip of 60°."""
SHIFT_OVER_NOISE = 3.0
"""Of the noise: a smaller step does not stand out of the readings."""
MIN_READINGS = 12
"""Fewer readings than this cannot be judged: nine unknowns leave nothing to check them by."""
SWITCH_PRICE = 15.0
"""Of a switch between lasting states, in log-likelihood: by chance one in e¹⁵ rows."""
MOST_ROWS = 20_000
"""Rows that are enough to tell of all."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """What a magnitude fit leaves to be examined, all in the unit of the readings. `readings` (n,
    3), `time` (n,) or None, `residuals` (n,), `weights` (n,), `normals` (n, 3) the unit directions
    in which a residual is measured; `bias` and `radius` of the readings' ellipsoid and `shape` (3,
    3) the matrix over its mean gain; `noise`; `known_radius` what the radius is at least, as far as
    that is known; `unknowns` those that the readings have to determine."""

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

    @cached_property
    def flatness(self) -> tuple[float, Array, Array]:
        """How thick the readings are across their plane, over the radius; its normal (3,); and the
        readings (k, 3) that count."""
        counted = (self.weights > 0) | (self.weights == 0).all()
        used, crowding = self.readings[counted], self.crowding[counted]
        some = choose_evenly(len(used), MOST_ROWS), choose_spread_rows(crowding, most=MOST_ROWS)
        measured = (measure_thickness(used[rows]) for rows in some)
        return *max(measured, key=lambda one: one[0]), used
