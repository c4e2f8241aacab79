"""`Flight`: what a page about a flight is drawn from, after a fit or after the tracker."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration
from agonic.calibration.thermal import Thermal
from agonic.calibration.tracking import Jump
from agonic.inflight.fit import InflightFit, prior
from agonic.inflight.fit.pointing import find_eclipse
from agonic.inflight.maths import correlated_errors
from agonic.inflight.tracking import Coefficients, Tracker
from agonic.maths.estimation.noise.residuals import correlation_length
from agonic.maths.rotations.polar import split_rotation
from agonic.report.digits import group_digits
from agonic.samples import Samples

FIXED = 2 * prior.FIXED
"""Relative standard error below which a number was fixed."""
_NAMES = ("x", "y", "z", "xx", "yy", "zz", "xy", "xz", "yz")


class Comparison(NamedTuple):
    """One number: on the ground (`None` where there was none) and in flight, each with its sd."""

    name: str
    ground: float | None
    ground_sd: float | None
    flight: float
    flight_sd: float

    @property
    def change_sd(self) -> float:
        """√(ground² + flight²): the two were made from different readings."""
        return float(np.hypot(self.ground_sd or 0.0, self.flight_sd))

    @property
    def fixed(self) -> bool:
        """Whether the flight was not asked for it: a standard error that is as good as none."""
        return self.flight_sd <= FIXED * max(abs(self.flight), 1.0)

    @property
    def sigmas(self) -> float | None:
        """The change in units of its standard error; `None` where there is none to speak of."""
        known = self.ground is not None and not self.fixed
        return (self.flight - self.ground) / self.change_sd if known else None  # type: ignore[operator]


class Numbers(NamedTuple):
    """Numbers of one kind, which share a unit ("" for ratios), and what to know of them."""

    name: str
    unit: str
    rows: list[Comparison]
    note: str = ""


def compare(before: Affine | None, after: Affine, note: str = "") -> tuple[Numbers, ...]:
    """Bias and symmetric matrix before and after: of the turn magnitudes say nothing."""
    unknown = [None] * 9
    flight, flight_sd = _find_nine(after)
    ground, ground_sd = (unknown, None) if before is None else _find_nine(before)
    columns = ground, ground_sd or unknown, flight, flight_sd or [0.0] * 9
    rows = [Comparison(*row) for row in zip(_NAMES, *columns, strict=True)]
    return Numbers("Bias", after.unit_in, rows[:3], note), Numbers("Matrix", "", rows[3:])


def _find_nine(calibration: Affine) -> tuple[list[float], list[float] | None]:
    """Bias and the six entries of the symmetric matrix, and their standard errors."""
    size, known = 12 if calibration.gauge == "free" else 9, calibration.covariance
    plain = None if known is None else known[:size, :size]
    six, rest = split_rotation(calibration.matrix, plain, calibration.gauge)
    nine = np.concatenate([calibration.bias, six]).tolist()
    if known is None:
        return nine, None
    return nine, np.sqrt(np.maximum(np.diag(rest.covariance)[:9], 0.0)).tolist()


class Course(NamedTuple):
    """A bias (k, 3) and its standard error (k, 3) at times (k,), s, with the jumps on the way."""

    time: Array
    bias: Array
    sd: Array
    unit: str
    jumps: tuple[Jump, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight:
    """Residuals of a flight with what was recorded beside them, and what they led to.

    `residuals` (n,) nT, `used` (n,) whether each were used for the result. `latitude_deg` …
    `eclipse` (n,) are `None` where the log cannot tell. `fit` is there after a fit; else each
    residual is from before its reading was used. `noise` is the standard deviation of a residual,
    nT; `correlation` how many of them count as one; `lasting_nT` of it are correlated errors, for
    `lasting_s` until it has fallen to 1/e (0 where none was seen).
    """

    sensor: str
    calibration: Calibration
    samples: Samples | None
    time: Array
    epoch: datetime | None
    residuals: Array
    used: Mask
    latitude_deg: Array | None
    temperature: Array | None
    eclipse: Mask | None
    noise: float
    correlation: float
    lasting_nT: float
    lasting_s: float
    course: Course
    numbers: tuple[Numbers, ...]
    left_out: Mapping[str, int]
    fit: InflightFit | None = None

    @property
    def longitude_deg(self) -> Array | None:
        """Of each reading, (n,)."""
        return None if self.samples is None else self.samples.longitude_deg

    @property
    def begun(self) -> str:
        """When the first reading was taken and how long the record is."""
        lasted = timedelta(seconds=round(float(self.time[-1] - self.time[0])))
        if self.epoch is None:
            return f"{lasted} long"
        first = self.epoch + timedelta(seconds=float(self.time[0]))
        return f"{first:%Y-%m-%d %H:%M:%S} UTC, {lasted} long"


_OF_FIT = (
    *("calibration", "time", "epoch", "residuals", "eclipse", "noise", "correlation"),
    *("lasting_nT", "lasting_s", "latitude_deg", "temperature"),
)
"""What a fit has under the same names."""


def flight_of_fit(fit: InflightFit, samples: Samples | None = None) -> Flight:
    """A fit in flight as the page takes it; with the samples, which know where each row was."""
    if samples is not None and len(samples) != len(fit.residuals):
        samples = None
    moments = np.linspace(fit.drift.start, fit.drift.stop, 600)
    before, after, note = fit.before, fit.after, ""
    if before is None and fit.ground is not None:  # no bias and matrix: what flight adds to it
        before, after = Affine(bias=np.zeros(3), matrix=np.eye(3)), fit.change
        note = "added to the field by the ground calibration; 0 changes nothing"
    elif isinstance(fit.ground, Thermal) and fit.temperature is not None:
        note = f"both at {group_digits(float(fit.temperature.mean()), 1)} °C"
    return Flight(
        **{name: getattr(fit, name) for name in _OF_FIT},
        sensor=fit.change.sensor,
        samples=samples,
        used=fit.weights > 0,
        course=Course(moments, *fit.bias_at(moments), fit.change.unit_in),
        numbers=compare(before, after, note),
        left_out=_count_left_out(fit, samples),
        fit=fit,
    )


def flight_of_log(tracker: Tracker, found: Coefficients, samples: Samples) -> Flight:
    """What the tracker made of a log: `samples` are the readings that `found` is about."""
    state, base = tracker.state, tracker.state.base
    time = tracker.seconds(samples)
    latest = slice(-(1 << 19), None)
    # of a start the predictions say how little was known, and nothing of model and noise
    used = found.used & found.foretold
    lasting_nT, lasting_s = measure_correlated_errors(time, found.residual, used)
    refused, taken = (int(np.count_nonzero(rows)) for rows in (~found.used, used))
    from_nothing = base.covariance is None and not base.bias.any()
    note = "" if state.ground is None else f"both at {group_digits(state.ground.centre_C, 1)} °C"
    return Flight(
        sensor=base.sensor,
        calibration=tracker.calibration if state.thermal is None else state.thermal,
        samples=samples,
        time=time,
        latitude_deg=samples.latitude_deg,
        temperature=samples.temperature,
        epoch=state.epoch,
        residuals=found.residual,
        used=used,
        eclipse=find_eclipse(samples),
        noise=float(np.sqrt(np.mean(found.residual[used] ** 2))) if taken else 0.0,
        correlation=correlation_length(found.residual[latest], used[latest].astype(np.float64)),
        lasting_nT=lasting_nT,
        lasting_s=lasting_s,
        course=find_course(tracker),
        numbers=compare(None if from_nothing else base, tracker.calibration, note),
        left_out={
            **samples.rejected,
            f"beyond {tracker.params.gate:g} standard deviations of its prediction": refused,
            "used, before enough was known to judge them": len(used) - refused - taken,
        },
    )


def find_course(tracker: Tracker) -> Course:
    """The bias that a tracker has found, from its first log to now."""
    state = tracker.state
    whole = np.vstack([tracker.history, [state.time, *state.bias, *state.bias_sd]])
    return Course(whole[:, 0], whole[:, 1:4], whole[:, 4:], state.base.unit_in, state.jumps)


def measure_correlated_errors(time: Array, residuals: Array, used: Mask) -> tuple[float, float]:
    """Of residuals (n,) what is correlated, nT, and for how long, s; 0 and 0 where none is seen."""
    n = len(residuals)
    k = min(n, correlated_errors.STRETCHES)
    weights, ones = used.astype(np.float64), np.ones((n, 1))
    sums = correlated_errors.Sums.empty(k, 1, [1])
    sums.add(np.arange(n) * k // n, weights, residuals, ones, [ones])
    white = float(np.average(residuals**2, weights=weights)) if used.any() else 0.0
    step_s = float(time[-1] - time[0]) / k
    found = correlated_errors.find_correlated_errors(sums, white, step_s)
    variance, time_s = correlated_errors.join_errors(found)
    return float(np.sqrt(min(variance, white))), time_s


def _count_left_out(fit: InflightFit, samples: Samples | None) -> dict[str, int]:
    """The readings that had no part in the fit, by reason."""
    without = int(np.count_nonzero(fit.weights == 0))
    excluded = min(int(fit.change.provenance.settings.get("excluded", 0)), without)
    flags = None if samples is None else samples.flagged
    flagged = 0 if flags is None else min(int(np.count_nonzero(flags)), excluded)
    return {
        **({} if samples is None else samples.rejected),
        "flagged in the log (torquers on and the like)": flagged,
        "unusable, excluded by hand or outside the latitudes asked for": excluded - flagged,
        "do not fit: no weight in the robust loss": without - excluded,
    }
