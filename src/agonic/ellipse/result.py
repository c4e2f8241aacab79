"""`EllipseFit`: the calibration of a two-axis compass, with its evidence."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from agonic.arrays import Array, Index
from agonic.calibration.affine import Affine
from agonic.fit import Estimated
from agonic.health import Finding, sort_findings
from agonic.readable import Shown
from agonic.samples import Samples


@dataclass(frozen=True, kw_only=True, eq=False)
class EllipseFit(Estimated):
    """A two-axis compass calibrated, and what the calibration rests on.

    `calibration` has model "ellipse": of z its bias, and the covariance with z in it, are 0.
    `residuals` (n,) are distances from the ellipse in the unit of the readings, `weights` (n,) what
    the robust loss left of each; `noise` the standard deviation of one reading on one axis,
    `correlation` the correlation length in readings; `sectors` (24,) the readings in each 15° of
    the circle, of few readings (12,) in each 30°; `heading_sd_deg` the standard error of a level
    heading that the calibration makes, rms over all headings; `spread_before` and `spread_after`
    that of the magnitude, over its mean; `inclination_deg` the dip of the place, None where it is
    not known.
    """

    samples: Samples
    calibration: Affine
    n: Annotated[int, Shown()]
    residuals: Array
    weights: Array
    noise: Annotated[float, Shown()]
    correlation: Annotated[float, Shown()]
    sectors: Index
    heading_sd_deg: Annotated[float, Shown()]
    spread_before: Annotated[float, Shown()]
    spread_after: Annotated[float, Shown()]
    inclination_deg: Annotated[float | None, Shown()] = None
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def covariance(self) -> Array:
        """The covariance (9, 9) of the calibration; 0 wherever z is in it."""
        return super().covariance

    @property
    def bias(self) -> Array:
        """The bias (3,), 0 along z, in the unit of the readings."""
        return self.calibration.bias

    @property
    def matrix(self) -> Array:
        """The matrix (3, 3); of z it says nothing."""
        return self.calibration.matrix

    @property
    def seen_deg(self) -> float:
        """How much of the circle was seen."""
        return float(np.count_nonzero(self.sectors)) * 360.0 / len(self.sectors)

    @property
    def noise_deg(self) -> float:
        """The noise of one reading as an angle of the heading."""
        gain = float(np.trace(self.matrix[:2, :2])) / 2
        return float(np.degrees(self.noise * gain / (self.calibration.magnitude or 1.0)))

    def with_findings(self, *more: Finding | None) -> EllipseFit:
        """The fit with further findings; a refused fit boasts of no accuracy."""
        fit = replace(self, findings=sort_findings((*self.findings, *more)))
        return replace(fit, remarks=()) if fit.verdict == "refused" else fit
