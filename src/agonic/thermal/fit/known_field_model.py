"""Which order in temperature, and whether a term in its rate, readings in a known field ask for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.errors import CoverageError
from agonic.fit import ModelTest
from agonic.maths.equation.temperature_model import build_covariates
from agonic.maths.estimation import series
from agonic.maths.estimation.inference.model_averaging import average_over_term
from agonic.maths.estimation.inference.wald import wald
from agonic.maths.estimation.noise.residuals import noise_scale, robust_scale
from agonic.samples import Samples
from agonic.thermal.fit.scale import NO_LAG, Scale
from agonic.thermal.fit.settings import LARGEST_AUTO, Settings
from agonic.thermal.maths.known_field import (
    KnownFieldEstimate,
    KnownFieldProblem,
    estimate_known_field,
)

_SIGNIFICANT = 1e-4
_MARKED = 0.01  # of the residual variance: what a further order must take off
_FURTHER, _LAGGING = 0.5, 0.1
"""Probability of a further order, and of a lag, before the readings are seen."""
_SEEN = 0.7
"""That after, below which an order is left out."""


class KnownFieldReadings(NamedTuple):
    """Points and fields (n, 3) of size one, temperatures as −1…1, and how fast they change."""

    points: Array
    fields: Array
    x: Array
    lag: Array | None
    scale: Scale
    magnitude: float

    def estimate(
        self, degree: int, robust: bool, rate: bool = False, start: Array | None = None
    ) -> Estimated:
        """The problem of an order, with the term in dT/dt or without, and its estimate."""
        problem = self.pose(degree, rate)
        return problem, estimate_known_field(problem, robust=robust, start=start)

    def pose(self, degree: int, rate: bool) -> KnownFieldProblem:
        """The problem of an order, with the term in dT/dt or without."""
        phi = build_covariates(self.x, 0.0, degree, self.lag if rate else None)
        return KnownFieldProblem(self.points, self.fields, phi, degree, rate)


Estimated = tuple[KnownFieldProblem, KnownFieldEstimate]


def normalise(
    samples: Samples, field: Array, level: Array, settings: Settings
) -> KnownFieldReadings:
    centre = samples.field.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum((samples.field - centre) ** 2, axis=1))))
    if not size > 0:
        raise CoverageError("the readings never change: the sensor is stuck")
    magnitude = float(np.sqrt(np.mean(np.sum(field**2, axis=1))))
    lag, pace = None, 1.0
    if settings.rate is not False and samples.time is not None:
        rate = series.compute_rates(samples.time, level)
        pace = float(np.sqrt(np.mean(rate**2))) or 1.0
        lag = rate / pace if np.any(rate) else None
    scale = Scale(centre, size, float(level.min()), float(level.max()), pace, magnitude)
    points = (samples.field - centre) / size
    return KnownFieldReadings(points, field / magnitude, scale.x(level), lag, scale, magnitude)


def choose_model(
    readings: KnownFieldReadings, settings: Settings, unit: str
) -> tuple[KnownFieldProblem, KnownFieldEstimate, tuple[ModelTest, ...], Array | None]:
    """The estimate of the order that was asked for or is needed, with the rate where it shows, and
    the variance of the residuals by order where it was looked for.

    What a test does not see is not zero: an order that was looked for is averaged with the next,
    and coefficients of the temperature hold what a rate would change of them.
    """
    curve: Array | None = None
    if settings.degree == "auto":
        orders = range(LARGEST_AUTO + 1)
        estimates = (readings.estimate(order, settings.robust)[1] for order in orders)
        curve = np.array([_measure_unseen(estimate) ** 2 for estimate in estimates])
        degree = _choose_degree(curve)
        most = min(degree + 1, LARGEST_AUTO)
    else:
        degree = most = settings.degree
    chosen = readings.estimate(degree, settings.robust)
    tests: tuple[ModelTest, ...] = ()
    if readings.lag is not None:
        chosen, test = _choose_rate(readings, chosen, settings, unit)
        tests = (test,)
    return *_average(readings, chosen, most, settings), tests, curve


def _choose_rate(
    readings: KnownFieldReadings, plain: Estimated, settings: Settings, unit: str
) -> tuple[Estimated, ModelTest]:
    """The estimate with the term in dT/dt where it is asked for or surely there, and its test."""
    start = np.concatenate([plain[1].solution.params, np.zeros(3)])
    lagging = readings.estimate(plain[0].degree, settings.robust, rate=True, start=start)
    solution, noise = lagging[1].solution, lagging[1].noise
    term = solution.params[-3:]
    independent = len(readings.points) / noise.correlation
    statistic, p_value = wald(term, solution.covariance[-3:, -3:], independent)
    better = _measure_unseen(lagging[1]) < _measure_unseen(plain[1])
    there = settings.rate is True or (p_value < _SIGNIFICANT and better)
    words = readings.scale.describe_lag(term, unit) if there else NO_LAG
    test = ModelTest(
        smaller="temperature", larger="rate", statistic=statistic, p_value=p_value, sentence=words
    )
    return lagging if there else plain, test


def _average(
    readings: KnownFieldReadings, chosen: Estimated, most: int, settings: Settings
) -> Estimated:
    """The chosen estimate averaged over terms that it may lack: a rate, and the order above.

    The rate itself is left out: it comes and goes, and the correction shall not need it. An order
    that explains no more than chance does is left out too.
    """
    problem, estimate = chosen
    lacks_rate = readings.lag is not None and not problem.rate
    if not lacks_rate and most == problem.degree:
        return chosen
    _, fullest = readings.estimate(most, settings.robust, rate=lacks_rate or problem.rate)
    found, covariance = fullest.solution.params, fullest.solution.covariance
    if lacks_rate:
        found, covariance, _ = average_over_term(found, covariance, slice(-3, None), _LAGGING)
        found, covariance = found[:-3], covariance[:-3, :-3]
    last = np.arange(most, 12 * (most + 1), most + 1)  # of bias and matrix
    if most > problem.degree:
        likely = 0.0
        for term in (last[3:], last[:3]):
            found, covariance, there = average_over_term(found, covariance, term, _FURTHER)
            likely = max(likely, there)
        if likely < _SEEN:
            kept = np.setdiff1d(np.arange(len(found)), last)
            found, covariance, most = found[kept], covariance[np.ix_(kept, kept)], problem.degree
        else:
            estimate = fullest
    solution = estimate.solution._replace(params=found, covariance=covariance)
    return readings.pose(most, problem.rate), estimate._replace(solution=solution)


def _measure_unseen(estimate: KnownFieldEstimate) -> float:
    """The standard deviation of what readings are off by where the fit has not seen them."""
    left = estimate.unseen.ravel()
    return noise_scale(left, estimate.noise.loss, robust_scale(left), 0)


def _choose_degree(variances: Array) -> int:
    """The smallest order after which the variance of unseen readings stops falling markedly."""
    for order in range(LARGEST_AUTO):
        if (variances[order + 1 :] > (1 - _MARKED) * variances[order]).all():
            return order
    return LARGEST_AUTO
