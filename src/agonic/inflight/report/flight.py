"""`Flight`: what a page about a flight is drawn from, after a fit or after the tracker."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta

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
_AXES = ("x", "y", "z")
_ENTRIES = ("xx", "yy", "zz", "xy", "xz", "yz")


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """One number: on the ground (`None` where there was none) and in flight, each with its sd."""

    name: str
    ground: float | None
    ground_sd: float | None
    flight: float
    flight_sd: float

    @property
    def change(self) -> float | None:
        """Flight less ground."""
        return None if self.ground is None else self.flight - self.ground

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
        return None if self.change is None or self.fixed else self.change / self.change_sd


@dataclass(frozen=True, kw_only=True)
class Numbers:
    """Numbers of one kind, which share a unit ("" for ratios), and what to know of them."""

    name: str
    unit: str
    rows: tuple[Comparison, ...]
    note: str = ""


def compare(before: Affine | None, after: Affine, note: str = "") -> tuple[Numbers, ...]:
    """Bias and symmetric matrix before and after: of the turn magnitudes say nothing.

    >>> made = Affine(bias=[100.0, 0, 0], matrix=np.eye(3), covariance=np.eye(9) * 0.25)
    >>> bias, _ = compare(made, made)
    >>> bias.rows[0].change, round(bias.rows[0].change_sd, 3)
    (0.0, 0.707)
    """
    flight, flight_sd = _nine(after)
    ground, ground_sd = (None, None) if before is None else _nine(before)

    rows = tuple(
        Comparison(
            name=name,
            ground=None if ground is None else float(ground[k]),
            ground_sd=None if ground_sd is None else float(ground_sd[k]),
            flight=float(flight[k]),
            flight_sd=0.0 if flight_sd is None else float(flight_sd[k]),
        )
        for k, name in enumerate((*_AXES, *_ENTRIES))
    )
    return (
        Numbers(name="Bias", unit=after.unit_in, rows=rows[:3], note=note),
        Numbers(name="Matrix", unit="", rows=rows[3:]),
    )


def _nine(calibration: Affine) -> tuple[Array, Array | None]:
    """Bias and the six entries of the symmetric matrix, and their standard errors."""
    size, known = 12 if calibration.gauge == "free" else 9, calibration.covariance
    plain = None if known is None else known[:size, :size]
    six, rest = split_rotation(calibration.matrix, plain, calibration.gauge)
    sd = None if known is None else np.sqrt(np.maximum(np.diag(rest.covariance)[:9], 0.0))
    return np.concatenate([calibration.bias, six]), sd


def compare_fit(fit: InflightFit) -> tuple[Numbers, ...]:
    """The numbers of a fit in flight beside those of the ground at the same temperature."""
    ground = fit.ground
    if fit.before is None and ground is not None:
        # a ground calibration that is no bias and matrix: what the flight adds to its field
        none = Affine(bias=np.zeros(3), matrix=np.eye(3))
        note = "added to the field by the ground calibration; 0 changes nothing"
        return compare(none, fit.change, note)
    note = ""
    if isinstance(ground, Thermal) and fit.temperature is not None:
        note = f"both at {group_digits(float(fit.temperature.mean()), 1)} °C"
    return compare(fit.before, fit.after, note)


def compare_tracker(tracker: Tracker) -> tuple[Numbers, ...]:
    """The numbers of a tracker now beside those that it started from."""
    state = tracker.state
    base = state.base
    from_nothing = base.covariance is None and not base.bias.any()
    note = "" if state.ground is None else f"both at {group_digits(state.ground.centre_C, 1)} °C"
    return compare(None if from_nothing else base, tracker.calibration, note)


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

    `residuals` (n,) nT, `used` (n,) whether each were used for the result. `latitude_deg` …
    `eclipse` (n,) are `None` where the log cannot tell. `fit` is there after a fit. `noise` is the
    standard deviation of a residual, nT; `correlation` how many of them count as one; `lasting_nT`
    of it are correlated errors, for `lasting_s` until it has fallen to 1/e (0 where none was seen).
    """

    sensor: str
    calibration: Calibration
    samples: Samples | None
    time: Array
    epoch: datetime | None
    residuals: Array
    used: Mask
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
    fit: InflightFit | None = None

    @property
    def predicted(self) -> bool:
        """Whether each residual is from before its reading was used."""
        return self.fit is None

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
    if samples is not None and len(samples) != len(fit.residuals):
        samples = None
    moments = np.linspace(fit.drift.start, fit.drift.stop, CURVE)
    bias, sd = fit.bias_at(moments)
    return Flight(
        **{name: getattr(fit, name) for name in _OF_FIT},
        sensor=fit.change.sensor,
        samples=samples,
        used=fit.weights > 0,
        longitude_deg=None if samples is None else samples.longitude_deg,
        course=Course(time=moments, bias=bias, sd=sd, unit=fit.change.unit_in),
        numbers=compare_fit(fit),
        left_out=_count_left_out(fit, samples),
        fit=fit,
    )


_OF_FIT = (
    *("calibration", "time", "epoch", "residuals", "eclipse", "noise", "correlation"),
    *("lasting_nT", "lasting_s", "latitude_deg", "temperature"),
)
"""What a fit has under the same names."""


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
    lasting_nT, lasting_s = measure_correlated_errors(time, found.residual, used)
    refused = int(np.count_nonzero(~found.used))
    return Flight(
        sensor=state.base.sensor,
        calibration=tracker.calibration if state.thermal is None else state.thermal,
        samples=samples,
        time=time,
        latitude_deg=samples.latitude_deg,
        longitude_deg=samples.longitude_deg,
        temperature=samples.temperature,
        epoch=state.epoch,
        residuals=found.residual,
        used=used,
        eclipse=find_eclipse(samples),
        noise=float(np.sqrt(np.mean(found.residual[used] ** 2))) if used.any() else 0.0,
        correlation=correlation_length(found.residual[latest], used[latest].astype(np.float64)),
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
            "used, before enough was known to judge them": len(used)
            - refused
            - int(np.count_nonzero(used)),
        },
    )


def measure_correlated_errors(time: Array, residuals: Array, used: Mask) -> tuple[float, float]:
    """Of residuals (n,) what is correlated, nT, and for how long, s; 0 and 0 where none is seen.

    >>> white = np.random.default_rng(0).normal(size=5000)
    >>> measure_correlated_errors(np.arange(5000.0), white, np.ones(5000, dtype=bool))
    (0.0, 0.0)
    """
    n = len(residuals)
    k = min(n, correlated_errors.STRETCHES)
    weights, ones = used.astype(np.float64), np.ones((n, 1))
    sums = correlated_errors.Sums.empty(k, 1, [1])
    sums.add(np.arange(n) * k // n, weights, residuals, ones, [ones])
    white = float(np.average(residuals**2, weights=weights)) if used.any() else 0.0
    step_s = float(time[-1] - time[0]) / k
    variance, time_s = correlated_errors.join_errors(
        correlated_errors.find_correlated_errors(sums, white, step_s)
    )
    return float(np.sqrt(min(variance, white))), time_s


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
