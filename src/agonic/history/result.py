"""What became of the calibration of one sensor over time: trends, steps and outliers."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

import numpy as np

from agonic.arrays import Array, Index
from agonic.health import Finding
from agonic.health.finding import Judged
from agonic.history.maths.change_points import ChangePoint
from agonic.history.maths.drift_model import Posterior, Series, mix_normals, predict
from agonic.population import Population
from agonic.readable import Shown

YEAR_S = 365.25 * 86_400.0


@dataclass(frozen=True)
class Band:
    """A parameter at some moments: expected, its standard deviation, and that of a calibration of
    the usual quality there, each (k,).
    """

    mean: Array
    sd: Array
    calibration_sd: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Trend:
    """One parameter of a sensor: a line, a random walk, and scatter of its calibrations.

    `time` (n,) in seconds since 1970, `value` and `sd` (n,) as calibrated, NaN where a calibration
    has no such parameter. `slope` and `slope_sd`
    are a year's; `p_value` how often chance makes such a slope. `scatter` is what calibrations
    differ by beyond their standard errors, `walk` its random walk in a year, both
    as root mean squares over the posterior.
    """

    name: Annotated[str, Shown(key="parameter")]
    unit: Annotated[str, Shown()]
    time: Array
    value: Array
    sd: Array
    slope: Annotated[float, Shown(key="slope_per_year")]
    slope_sd: Annotated[float, Shown(key="slope_sd_per_year")]
    p_value: Annotated[float, Shown()]
    scatter: Annotated[float, Shown()]
    walk: Annotated[float, Shown(key="walk_per_root_year")]
    series: Series
    posterior: Posterior
    shifts: tuple[ChangePoint, ...]

    def at(self, time: Array) -> Band:
        """The parameter at moments (k,), seconds since 1970 and not before the first calibration.

        Between two calibrations that a step lies between, the level before it still holds.
        """
        order = np.argsort(time, kind="stable")
        mean, variance = predict(
            self.series, self.posterior, self._scaled(time)[order], self._design(time)[:, order]
        )
        usual = float(np.nanmedian(self.sd)) ** 2
        more = variance + self.posterior.scatter[:, None] ** 2 + usual
        weight = self.posterior.weight
        back = np.argsort(order, kind="stable")
        centre, sd = mix_normals(weight, mean.T, variance.T)
        _, wide = mix_normals(weight, mean.T, more.T)
        return Band((centre + self.offset)[back], sd[back], wide[back])

    def predict(self, moment: datetime) -> tuple[float, float, float]:
        """The parameter then, its sd, and that of a calibration of usual quality."""
        band = self.at(np.array([moment.timestamp()]))
        return float(band.mean[0]), float(band.sd[0]), float(band.calibration_sd[0])

    @property
    def kind(self) -> str:
        """Bias, gain or cross."""
        return self.name.split()[0]

    @property
    def offset(self) -> float:
        """What was taken off the values before anything else."""
        return float(np.nanmean(self.value))

    def _scaled(self, time: Array) -> Array:
        return np.asarray((time - self.time[0]) / (self.time[-1] - self.time[0]))

    def _design(self, time: Array) -> Array:
        steps = [time >= self.time[s.place] if not s.outlier else 0 * time for s in self.shifts]
        return np.array([np.ones_like(time), self._scaled(time), *steps], dtype=np.float64)


def make_series(time: Array, value: Array, sd: Array) -> Series:
    """A parameter as the kernels take it: time over its span, values about their mean. What a
    calibration does not tell is the mean, with an error that leaves it without weight."""
    span, known = (time - time[0]) / (time[-1] - time[0]), np.isfinite(value)
    about_mean = np.where(known, value - np.nanmean(value), 0.0)
    unknown = (1e4 * (np.ptp(value[known]) + sd[known].max())) ** 2
    variance = np.where(known, sd**2, unknown)
    return Series(span, about_mean, variance, np.stack([np.ones_like(span), span]))


def summarise(posterior: Posterior, span_s: float) -> dict[str, float]:
    """The figures of a trend by field name; the posterior's time runs from 0 to 1 over the span."""
    years = span_s / YEAR_S
    return {
        "slope": float(posterior.mean(1)) / years,
        "slope_sd": float(posterior.sd(1)) / years,
        "p_value": float(posterior.p_value(1)),
        "scatter": float(posterior.size("scatter")),
        "walk": float(posterior.size("walk")) / np.sqrt(years),
    }


@dataclass(frozen=True)
class ParameterChange:
    """By how much one parameter moved, with its standard deviation."""

    name: Annotated[str, Shown(key="parameter")]
    unit: Annotated[str, Shown()]
    size: Annotated[float, Shown()]
    sd: Annotated[float, Shown()]


@dataclass(frozen=True)
class Event:
    """What happened: a "step" between two calibrations, an "outlier", or a "last" one that is off.

    It lies after `after` and not later than `before`, the moment of calibration number `place` (of
    those that are compared). `p_value` is how often chance makes one like it anywhere in the
    history; `parameters` are those in which it shows.
    """

    kind: Annotated[str, Shown()]
    place: int
    after: Annotated[datetime, Shown()]
    before: Annotated[datetime, Shown()]
    p_value: Annotated[float, Shown()]
    parameters: Annotated[tuple[ParameterChange, ...], Shown()]


@dataclass(frozen=True, kw_only=True, eq=False)
class Drift(Judged):
    """How one sensor moved: a trend for each parameter, what happened, and findings.

    `population` holds all calibrations in order of time, `compared` the numbers of those that were
    compared. `trends` is empty where they are too few. `verdict`, `ok` and `status` as for a fit.
    """

    sensor: str
    at: datetime
    population: Population
    compared: Index
    trends: tuple[Trend, ...]
    events: tuple[Event, ...]
    findings: tuple[Finding, ...]
    remarks: tuple[str, ...]

    def trend(self, name: str) -> Trend:
        """The trend of "bias x" … "cross yz"; raises `KeyError` for one that is not followed."""
        return {one.name: one for one in self.trends}[name]
