"""`InflightFit`: a calibration made in flight, and what it rests on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agonic.calibration.affine import Affine
from agonic.calibration.chain import Chain
from agonic.fitting.inflight.drift import Drift
from agonic.health import Finding, Judged

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class InflightFit(Judged):
    """The result of `fit_inflight`.

    Parameters
    ----------
    calibration : the ground calibration brought up to date, or the one that was made, with the bias
        of the last reading.
    change : what was found in flight: field = matrix @ (ground field − bias), with covariance.
    drift : how the bias changed over the record.
    field : (n, 3) the field of every reading, with the bias of its time.
    residuals : (n,) magnitude less that of the reference, nT.
    weights : (n,) what the robust loss left of each reading, 0 for rows that were excluded.
    noise : standard deviation of a residual, nT: the sensor's noise and the model's error together.
    correlation, correlation_s : how many readings, and seconds, count as one, for errors of the
        model last.
    solve : what was estimated: "bias", "gains" or "full".
    held_out : rms of residuals that the fit had not seen, nT, by the number of knots tried.
    """

    calibration: Affine | Chain
    change: Affine
    drift: Drift
    n: int
    field: Array
    residuals: Array
    weights: Array
    noise: float
    correlation: float
    correlation_s: float
    condition: float
    iterations: int
    converged: bool
    solve: str
    held_out: dict[int, float]
    findings: tuple[Finding, ...] = ()
    remarks: tuple[str, ...] = ()

    @property
    def covariance(self) -> Array:
        """Covariance (9, 9) of `change`: bias x y z at the end, then matrix xx yy zz xy xz yz."""
        covariance = self.change.covariance
        assert covariance is not None, "a fit always carries a covariance"
        return covariance

    @property
    def sd(self) -> Array:
        """Standard errors (9,) of the same."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def bias_at(self, time: ArrayLike) -> tuple[Array, Array]:
        """The bias found in flight at times (k,) of the record, nT, and its standard error."""
        return self.drift.at(np.atleast_1d(np.asarray(time, dtype=np.float64)))
