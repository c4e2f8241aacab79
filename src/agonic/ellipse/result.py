"""`EllipseFit`: the calibration of a two-axis compass, with its evidence."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np

from agonic.arrays import Array, Index
from agonic.ellipse.maths.conic import find_sectors, fit_circle
from agonic.fit import Fit
from agonic.readable import Shown
from agonic.samples import Samples


@dataclass(frozen=True, kw_only=True, eq=False)
class EllipseFit(Fit):
    """A two-axis compass calibrated, and what the calibration rests on.

    `calibration` has model "ellipse": its bias along z, and the covariance of that, are 0, and its
    gain along z is the mean one.
    `residuals` (n,) are distances from the ellipse in the unit of the readings, `weights` (n,) what
    the robust loss left of each; `noise` the standard deviation of one reading on one axis,
    `correlation` the correlation length in readings; `heading_sd_deg` the standard error of a level
    heading that the calibration makes, rms over all headings, and `shares` what it is made of;
    `spread_before` and `spread_after` that of the magnitude, over its mean; `inclination_deg` the
    dip of the place, None where it is not known.
    """

    samples: Samples
    residuals: Array
    weights: Array
    n: Annotated[int, Shown()]
    noise: Annotated[float, Shown()]
    correlation: Annotated[float, Shown()]
    heading_sd_deg: Annotated[float, Shown()]
    spread_before: Annotated[float, Shown()]
    spread_after: Annotated[float, Shown()]
    inclination_deg: Annotated[float | None, Shown()] = None

    @cached_property
    def sectors(self) -> Index:
        """The readings in each 15° of the circle, (24,), of few readings in each 30°, (12,).

        About the ellipse or the circle of all readings, whichever has seen less: a small ellipse
        can close about the readings of a short arc.
        """
        used = self.samples.field[self.weights > 0, :2]
        about = [(self.bias[:2], self.matrix[:2, :2])]
        size = float(np.abs(used).max()) or 1.0
        about.append((fit_circle(used / size)[:2] * size, np.eye(2)))
        seen = [find_sectors((used - bias) @ matrix) for bias, matrix in about]
        return min(seen, key=np.count_nonzero)

    @property
    def seen_deg(self) -> float:
        """How much of the circle was seen."""
        return float(np.count_nonzero(self.sectors)) * 360.0 / len(self.sectors)
