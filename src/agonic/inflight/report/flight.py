"""`Flight`: what a page about a flight is drawn from, after a fit or after the tracker."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.base import Calibration
from agonic.calibration.tracking import Jump
from agonic.health import Finding
from agonic.inflight.fit import InflightFit
from agonic.inflight.fit.pointing import find_eclipse
from agonic.inflight.maths.correlated_errors import STRETCHES, Sums, find_correlated_errors
from agonic.inflight.report.ground import Numbers, compare_fit, compare_tracker
from agonic.inflight.tracking import Coefficients, Tracker
from agonic.maths.estimation.noise.residuals import correlation_length
from agonic.samples import Samples

CURVE = 600
"""Moments at which a bias is drawn."""
_ENOUGH = 1 << 19  # readings from which a correlation is known well enough


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """A bias (k, 3) and its standard error (k, 3) at times (k,), s, with the jumps on the way."""

    time: Array
    bias: Array
    sd: Array
    unit: str
    jumps: tuple[Jump, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight:
    """Residuals of a flight with what was recorded beside them, and what they led to.

    `residuals` (n,) nT, `used` (n,) whether each had a part in the result; `predicted` where each
    is from before the reading was used. `latitude_deg` … `eclipse` (n,) are `None` where the log
    cannot tell. `fit` is there after a fit. `noise` is the standard deviation of a residual, nT;
    `correlation` how many of them count as one; `lasting_nT` of it are correlated errors, for
    `lasting_s` until it has fallen to 1/e (0 where none was seen).
    """

    sensor: str
    verdict: str
    status: str
    findings: tuple[Finding, ...]
    calibration: Calibration
    samples: Samples | None
    time: Array
    epoch: datetime | None
    residuals: Array
    used: Mask
    predicted: bool
    latitude_deg: Array | None
    longitude_deg: Array | None
    temperature: Array | None
    eclipse: Mask | None
    noise: float
    correlation: float
    lasting_nT: float
    lasting_s: float
    course: Course
    numbers: tuple[Numbers, ...]
    left_out: Mapping[str, int]
    held_out: Mapping[int, float]
    chosen: int | None
    thinned: int = 1
    fit: InflightFit | None = None

    @property
    def step_s(self) -> float:
        """Seconds from reading to reading."""
        return float(np.median(np.diff(self.time))) if len(self.time) > 1 else 0.0

    @property
    def begun(self) -> str:
        """When the first reading was taken and how long the record is."""
        lasted = timedelta(seconds=round(float(self.time[-1] - self.time[0])))
        if self.epoch is None:
            return f"{lasted} long"
        first = self.epoch + timedelta(seconds=float(self.time[0]))
        return f"{first:%Y-%m-%d %H:%M:%S} UTC, {lasted} long"


def flight_of_fit(fit: InflightFit, samples: Samples | None = None) -> Flight:
    """A fit in flight as the page takes it; with the samples, which know where each row was."""
    time = fit.time
    if samples is not None and len(samples) != len(fit.residuals):
        samples = None
    moments = np.linspace(fit.drift.start, fit.drift.stop, CURVE)
    bias, sd = fit.bias_at(moments)
    return Flight(
        sensor=fit.change.sensor,
        verdict=fit.verdict,
        status=fit.status,
        findings=fit.findings,
        calibration=fit.calibration,
        samples=samples,
        time=time,
        epoch=fit.epoch,
        residuals=fit.residuals,
        used=fit.weights > 0,
        predicted=False,
        latitude_deg=fit.latitude_deg if samples is None else samples.latitude_deg,
        longitude_deg=None if samples is None else samples.longitude_deg,
        temperature=fit.temperature if samples is None else samples.temperature,
        eclipse=fit.eclipse,
        noise=fit.noise,
        correlation=fit.correlation,
        lasting_nT=fit.lasting_nT,
        lasting_s=fit.lasting_s,
        course=Course(time=moments, bias=bias, sd=sd, unit=fit.change.unit_in),
        numbers=compare_fit(fit),
        left_out=_count_left_out(fit, samples),
        held_out=fit.held_out,
        chosen=fit.drift.intervals,
        thinned=fit.thinned,
        fit=fit,
    )


def flight_of_log(tracker: Tracker, found: Coefficients, samples: Samples) -> Flight:
    """What the tracker made of a log: `samples` are the readings that `found` is about."""
    state = tracker.state
    time = tracker.seconds(samples)
    history = tracker.history
    last = np.concatenate([[state.time], state.bias, state.bias_sd])
    whole = np.concatenate([history, last[None]])
    latest = slice(-_ENOUGH, None)
    # of a start the predictions say how little was known, and nothing of model and noise
    used = found.used & found.foretold
    correlation = correlation_length(found.residual[latest], used[latest].astype(np.float64))
    lasting_nT, lasting_s = measure_correlated_errors(time, found.residual, used)
    refused = int(np.count_nonzero(~found.used))
    return Flight(
        sensor=state.base.sensor,
        verdict="good" if tracker.ok else "check",
        status=tracker.status,
        findings=tracker.findings,
        calibration=tracker.calibration if state.thermal is None else state.thermal,
        samples=samples,
        time=time,
        epoch=state.epoch,
        residuals=found.residual,
        used=used,
        predicted=True,
        latitude_deg=samples.latitude_deg,
        longitude_deg=samples.longitude_deg,
        temperature=samples.temperature,
        eclipse=find_eclipse(samples),
        noise=float(np.sqrt(np.mean(found.residual[used] ** 2))) if used.any() else 0.0,
        correlation=correlation,
        lasting_nT=lasting_nT,
        lasting_s=lasting_s,
        course=Course(
            time=whole[:, 0],
            bias=whole[:, 1:4],
            sd=whole[:, 4:],
            unit=state.base.unit_in,
            jumps=state.jumps,
        ),
        numbers=compare_tracker(tracker),
        left_out={
            **samples.rejected,
            f"beyond {tracker.params.gate:g} standard deviations of its prediction": refused,
            "learned from, but before enough was known to judge by it": len(used)
            - refused
            - int(np.count_nonzero(used)),
        },
        held_out={},
        chosen=None,
    )


def measure_correlated_errors(time: Array, residuals: Array, used: Mask) -> tuple[float, float]:
    """Of residuals (n,) what is correlated, nT, and for how long, s; 0 and 0 where none is seen.

    >>> white = np.random.default_rng(0).normal(size=5000)
    >>> measure_correlated_errors(np.arange(5000.0), white, np.ones(5000, dtype=bool))
    (0.0, 0.0)
    """
    n = len(residuals)
    k = min(n, STRETCHES)
    weights, ones = used.astype(np.float64), np.ones((n, 1))
    sums = Sums.empty(k, 1, [1])
    sums.add(np.arange(n) * k // n, weights, residuals, ones, [ones])
    white = float(np.average(residuals**2, weights=weights)) if used.any() else 0.0
    errors = find_correlated_errors(sums, white, float(time[-1] - time[0]) / k)
    variance = sum(error.variance for error in errors)
    if not variance:
        return 0.0, 0.0
    mean = sum(error.variance * error.time_s for error in errors) / variance
    return float(np.sqrt(min(variance, white))), mean


def _count_left_out(fit: InflightFit, samples: Samples | None) -> dict[str, int]:
    """The readings that had no part in the fit, by reason."""
    reasons = {} if samples is None else dict(samples.rejected)
    without = int(np.count_nonzero(fit.weights == 0))
    excluded = min(int(fit.change.provenance.settings.get("excluded", 0)), without)
    flagged = 0
    if samples is not None and samples.flagged is not None:
        flagged = min(int(np.count_nonzero(samples.flagged)), excluded)
    reasons["flagged in the log (torquers on and the like)"] = flagged
    reasons["unusable, excluded by hand or outside the latitudes asked for"] = excluded - flagged
    reasons["do not fit: no weight in the robust loss"] = without - excluded
    return reasons
