"""Bias and matrix over temperature in a known field: the orders in temperature are terms.

Every order of the bias and of the matrix, the lag in dT/dt, and a drift of the bias over time is a
term of the one model (`model.average`): how large it is the residuals tell, under a half-Cauchy
prior of what sensors do, and estimate and covariance are averages over that size. So no order is
chosen and then taken for known, and what hardly shows stays small outside of the temperatures and
directions that were seen. The drift is no part of a calibration: what it may have moved is in the
covariance. Where it shows, unseen blocks say whether it, or the temperature, is meant.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.errors import CoverageError
from agonic.fit import ModelTest
from agonic.maths.equation import polynomial
from agonic.maths.estimation import leastsq, series
from agonic.maths.estimation.loss import squares
from agonic.maths.estimation.noise.residuals import Noise, estimate_noise
from agonic.model.average import EVIDENCE, Base, Group, Prior, average, choose, solve
from agonic.model.terms.time import TIME
from agonic.samples import Samples
from agonic.thermal.fit.problem import LARGEST_AUTO, NO_LAG, Scale, Settings
from agonic.thermal.maths.known_field import (
    KnownFieldProblem,
    Linearised,
    compare_unseen,
    find_start,
    linearise,
    map_to_coefficients,
    measure_clustering,
    predict_unseen,
)

BIAS_PER_C, GAIN_PER_C = 5e-4, 1e-3
"""Scales of nature, of the field and of the gain a degree: magnetoresistors and magneto-inductors
without compensation (RM3100, MMC5983, HMC5883L data sheets)."""
SMALLER = 0.3
"""Of an order, the scale of the next."""
DRIFTS = 24
"""Cosines of time that a drift has: with noise whose memory is a sixtieth of the record, error over
standard error is 0.8, with twelve 1.25."""
LAG = 2e-3
"""Scale of what lags, of the field, at the rms pace of the temperature."""
ODDS = (0.9, 0.5, 0.25, 0.1, 0.05)
"""How often a sensor has a first, second, … order at all; a lag as often as a fourth."""
MOST = 100.0
NONE = Prior(np.zeros((12, 12)), np.zeros(12), 0.0)
"""What is known of the twelve numbers before."""
_CLEARLY = 0.15  # what leaving out stretches of readings must gain on unseen ones
_ROUNDS, _STEPS = 10, 5
_SETTLED = 1e-3  # of a variance


class KnownFieldReadings(NamedTuple):
    """Points and fields (n, 3) of size one, temperatures as −1…1, and how fast they change."""

    points: Array
    fields: Array
    x: Array
    lag: Array | None
    scale: Scale
    magnitude: float

    def pose(self, degree: int) -> KnownFieldProblem:
        """The problem of an order, with the pace of the temperature and cosines of time."""
        at = (np.arange(len(self.x)) + 0.5) / len(self.x)
        order = np.arange(1, DRIFTS + 1)
        drift = np.cos(np.pi * at[:, None] * order) / order
        lag = np.empty((len(self.x), 0)) if self.lag is None else self.lag[:, None]
        powers = polynomial.powers(self.x, degree)
        return KnownFieldProblem(self.points, self.fields, powers, np.hstack([lag, drift]))


class KnownFieldEstimate(NamedTuple):
    """Coefficients (a,) with their covariance, the noise of a reading on one axis, residuals (n, 3)
    by them and weights (n,); `unseen` (n, 3) are the residuals by the fit without the block in
    which a reading lies. `fitted` are the readings about the solution by the columns that it
    keeps."""

    degree: int
    rate: bool
    coefficients: Array
    covariance: Array
    noise: Noise
    residuals: Array
    weights: Array
    unseen: Array
    condition: float
    odds: float
    fitted: Linearised


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
    """The estimate up to the order that was asked for, or to the last that shows, with the lag
    where it shows or is asked for; and the variance of unseen residuals by order where it was
    looked for."""
    highest = LARGEST_AUTO if settings.degree == "auto" else settings.degree
    problem = readings.pose(highest)
    estimate = _Fitting(problem, readings, settings).estimate()
    curve = _measure_orders(problem, estimate) if settings.degree == "auto" else None
    if readings.lag is None:
        return problem, estimate, (), curve
    words = NO_LAG
    if estimate.rate:
        words = readings.scale.describe_lag(estimate.coefficients[-3:], unit)
    test = ModelTest(
        smaller="temperature",
        larger="rate",
        statistic=2.0 * estimate.odds,
        p_value=float(1.0 / (1.0 + np.exp(np.clip(estimate.odds, -700.0, 700.0)))),
        sentence=words,
    )
    return problem, estimate, (test,), curve


class _State(NamedTuple):
    """Unknowns (m, 3), the readings about them, cross-products of blocks by weight, and what the
    residuals show: terms by their sizes, and their base."""

    unknowns: Array
    fitted: Linearised
    sums: Array
    there: dict[int, float]
    base: Base


class _Fitting:
    """One problem with its terms."""

    def __init__(
        self, problem: KnownFieldProblem, readings: KnownFieldReadings, settings: Settings
    ) -> None:
        self.problem, self.settings = problem, settings
        self.start, self.response = find_start(problem)
        self.timed = readings.lag is not None
        self.highest = problem.powers.shape[1] - 1
        self.groups, self.columns = _list_terms(problem, readings.scale.half_C, self.timed)
        axes = len(self.start) * np.arange(3)[:, None]
        whole = [np.arange(4)[None] + axes, *(own[None] + axes for own in self.columns)]
        self.places = np.concatenate([each.ravel() for each in whole])

    def estimate(self) -> KnownFieldEstimate:
        """The estimate that foretells unseen readings best: with a drift where one shows, and
        outliers down-weighted."""
        first = self._fit(self.start, np.ones(len(self.problem.points)), None, self.groups)
        if len(self.groups) - 1 not in first.there:
            return self._estimate_robustly(self.groups[:-1], first)
        drifting = self._estimate_robustly(self.groups, first)
        return _choose_best(drifting, self._estimate_robustly(self.groups[:-1]), _CLEARLY)

    def _estimate_robustly(
        self, terms: list[Group], first: _State | None = None
    ) -> KnownFieldEstimate:
        """With some of the terms, from a first fit of all readings; outliers are down-weighted
        where that foretells unseen readings better.

        What a model lacks (hysteresis, a lag) spoils whole stretches of readings, and to leave
        those out fits the rest only.
        """
        weights = np.ones(len(self.problem.points))
        fitted = self._fit(self.start, weights, None, terms) if first is None else first
        noise = self._estimate_noise(fitted, False)
        plain = self._conclude(fitted, weights, noise, terms)
        noise = self._estimate_noise(fitted, self.settings.robust)
        if noise.loss == squares():
            return plain
        for _ in range(_ROUNDS):
            weights = noise.loss.weight((fitted.fitted.residuals / noise.sd) ** 2).min(axis=1)
            fitted = self._fit(fitted.unknowns, weights, noise, terms)
            before, noise = noise, self._estimate_noise(fitted, True)
            if noise.settled(before):
                break
        weighted = self._conclude(fitted, weights, noise, terms)
        return _choose_best(plain, weighted, _CLEARLY * measure_clustering(weights))

    def _estimate_noise(self, state: _State, robust: bool) -> Noise:
        """The noise of residuals, each axis in time order, one after the other."""
        return estimate_noise(
            state.fitted.residuals.T.ravel(), robust, len(state.base.columns) // 3
        )

    def _fit(self, start: Array, weights: Array, noise: Noise | None, terms: list[Group]) -> _State:
        """Gauss–Newton on the unknowns with the terms that are there; without a noise it is found
        along."""
        unknowns, there, blocks = start, dict[int, float](), self.problem.blocks()
        for _ in range(_STEPS):
            fitted = linearise(self.problem, unknowns, self.response)
            square = float(np.mean(weights[:, None] * fitted.residuals**2))
            variance = square if noise is None else noise.sd**2 * noise.correlation
            sums = fitted.sum_up(weights, blocks)
            gram = self._join_axes(sums.sum(axis=0)) / max(variance, 1e-24)
            there, base = choose(gram, NONE, terms, there)
            before = unknowns
            unknowns = self._place(base.columns, base.estimate)
            step = np.asarray(fitted.design @ (unknowns - before))
            if float(np.sum(weights[:, None] * step**2)) < _SETTLED * variance:
                break
        return _State(unknowns, fitted, sums, there, base)

    def _join_axes(self, sums: Array) -> Array:
        """The cross-products of all unknowns (u + 1, u + 1), whose design every axis has."""
        m = len(self.start)
        gram = np.zeros((3 * m + 1, 3 * m + 1))
        for axis in range(3):
            own = slice(axis * m, axis * m + m)
            gram[own, own] = sums[:m, :m]
            gram[own, -1] = gram[-1, own] = sums[:m, m + axis]
        gram[-1, -1] = np.trace(sums[m:, m:])
        at = np.append(self.places, 3 * m)
        return np.asarray(gram[np.ix_(at, at)])

    def _place(self, columns: Index, values: Array) -> Array:
        """Values of some unknowns among all, (m, 3)."""
        flat = np.zeros(3 * len(self.start))
        flat[self.places[columns]] = values
        return np.asarray(flat.reshape(3, -1).T)

    def _conclude(
        self, fitted: _State, weights: Array, noise: Noise, terms: list[Group]
    ) -> KnownFieldEstimate:
        """Estimate and covariance averaged over the sizes of all terms, as a calibration has
        them."""
        variance = max(noise.sd**2 * noise.correlation, 1e-24)
        gram = self._join_axes(fitted.sums.sum(axis=0)) / variance
        there, base = choose(gram, NONE, terms, fitted.there)
        lag = 2 * self.highest if self.timed else -1
        if self.timed and self.settings.rate is True and lag not in there:
            there = {**there, lag: self.groups[lag].scale}
            base = solve(gram, NONE, self.groups, there)
        size = len(self.places)
        found, covariance, ridge = np.zeros(size), np.zeros((size, size)), np.zeros(size)
        found[base.columns] = base.estimate
        covariance[np.ix_(base.columns, base.columns)] = base.inverse
        averaged = {
            i: average(gram, base, one) for i, one in enumerate(self.groups) if i not in there
        }
        shown = {*there, *(i for i, one in averaged.items() if one.odds > 0.0)}
        degree = self.highest
        if self.settings.degree == "auto":
            degree = max((1 + i // 2 for i in shown if i < 2 * self.highest), default=0)
        for i, one in averaged.items():
            own = self.groups[i].columns
            stays = i < 2 * degree
            ridge[own] = len(own) / max(float(np.trace(one.square)), 1e-24) if stays else 1e24
            spread = one.covariance if stays else one.square
            covariance[np.ix_(base.columns, base.columns)] += one.alias @ spread @ one.alias.T
            if stays:
                found[base.columns] -= one.alias @ one.mean
                found[own] = one.mean
                across = -one.alias @ one.covariance
                covariance[np.ix_(own, own)] = one.covariance
                covariance[np.ix_(base.columns, own)] = across
                covariance[np.ix_(own, base.columns)] = across.T
        for i, each in there.items():
            ridge[self.groups[i].columns] = each**-2
        ridge *= noise.sd**2 * noise.correlation
        odds = averaged[lag].odds if lag in averaged else EVIDENCE
        return self._summarise(
            found, covariance, ridge, fitted.sums, noise, weights, degree, lag in there, float(odds)
        )

    def _summarise(
        self,
        found: Array,
        covariance: Array,
        ridge: Array,
        sums: Array,
        noise: Noise,
        weights: Array,
        degree: int,
        rate: bool,
        odds: float,
    ) -> KnownFieldEstimate:
        """In the coefficients of a calibration, with what it leaves of blocks that it has not
        seen."""
        m, own = len(self.start), np.arange(4 * (degree + 1))
        kept = np.append(own, self.problem.orders) if rate else own
        flat = (kept + m * np.arange(3)[:, None]).ravel()
        whole, precisions = np.zeros((3 * m, 3 * m)), np.zeros(3 * m)
        whole[np.ix_(self.places, self.places)] = covariance
        precisions[self.places] = ridge
        unknowns = np.zeros((m, 3))
        unknowns[kept] = self._place(np.arange(len(found)), found)[kept]
        fitted = linearise(self.problem, unknowns, self.response)
        fitted = fitted._replace(design=fitted.design[:, kept])
        without, _ = predict_unseen(sums, np.arange(m), precisions[:m])
        unseen = [
            fitted.targets[rows] - fitted.design[rows] @ own[kept]
            for rows, own in zip(self.problem.blocks(), without, strict=True)
        ]
        onto = map_to_coefficients(self.response, degree, rate)
        return KnownFieldEstimate(
            degree=degree,
            rate=rate,
            coefficients=onto @ unknowns[kept].T.ravel(),
            covariance=onto @ whole[np.ix_(flat, flat)] @ onto.T,
            noise=noise,
            residuals=fitted.residuals,
            weights=weights,
            unseen=np.concatenate(unseen),
            condition=float(leastsq.condition(sums.sum(axis=0)[np.ix_(kept, kept)])),
            odds=odds,
            fitted=fitted,
        )


def _choose_best(
    plain: KnownFieldEstimate, other: KnownFieldEstimate, needed: float = 0.0
) -> KnownFieldEstimate:
    """The one that leaves less of unseen readings, the other by a share that is needed."""
    left = [compare_unseen(one.unseen, other.unseen) for one in (plain, other)]
    return other if left[1] < (1.0 - needed) * left[0] else plain


def _list_terms(
    problem: KnownFieldProblem, half_C: float, timed: bool
) -> tuple[list[Group], list[Index]]:
    """The terms after the twelve numbers that do not change, and the columns of each on an axis."""
    first = np.arange(4)
    listed: list[tuple[str, Index, float, float, float]] = []
    for k in range(1, problem.powers.shape[1]):
        odds, less = ODDS[min(k, len(ODDS)) - 1], half_C * SMALLER ** (k - 1)
        listed.append((f"bias {k}", 4 * k + first[:1], BIAS_PER_C * less, odds, MOST))
        listed.append((f"matrix {k}", 4 * k + first[1:], GAIN_PER_C * less, odds, MOST))
    if timed:
        listed.append(("lag", np.array([problem.orders]), LAG, ODDS[3], MOST))
    drift = np.arange(problem.orders + timed, problem.orders + problem.others.shape[1])
    of = TIME[0]
    listed.append(("drift", drift, of.scale, of.odds, of.most))
    groups, at = [], 12
    for name, own, scale, odds, most in listed:
        groups.append(Group(name, at + np.arange(3 * len(own)), scale, odds, most))
        at += 3 * len(own)
    return groups, [own for _, own, *_ in listed]


def _measure_orders(problem: KnownFieldProblem, estimate: KnownFieldEstimate) -> Array:
    """The mean square of what each order (highest + 1,) leaves of blocks that it has not seen, by
    algebra about the fit of all orders."""
    weights, highest = estimate.weights, problem.powers.shape[1] - 1
    design = problem.expand(estimate.fitted.design[:, 1:4])
    sums = estimate.fitted._replace(design=design).sum_up(weights, problem.blocks())
    left = [
        predict_unseen(sums, np.arange(4 * order), np.zeros(4 * order))[1].sum()
        for order in range(1, highest + 2)
    ]
    return np.array(left) / (3 * float(weights.sum()))
