"""Bias and matrix over temperature in a known field: the orders in temperature are terms.

    raw = b(x) + W(x)⁻¹ field + l dT/dt,   b(x) = Σ b_k xᵏ,   W(x) = Σ W_k xᵏ,   x = −1…1

Every order of the bias and of the matrix, and the lag l, is a term of the one model
(`model.average`): how large it is the residuals tell, under a half-Cauchy prior of what sensors do,
and estimate and covariance are averages over that size. So no order is chosen and then taken for
known, and what hardly shows stays small outside of the temperatures and directions that were seen.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.errors import CoverageError
from agonic.fit import ModelTest
from agonic.maths.equation.temperature_model import build_covariates
from agonic.maths.estimation import leastsq, series
from agonic.maths.estimation.loss import squares
from agonic.maths.estimation.noise.residuals import Noise
from agonic.model.average import EVIDENCE, Base, Group, Prior, average, choose, solve
from agonic.samples import Samples
from agonic.thermal.fit.scale import NO_LAG, Scale
from agonic.thermal.fit.settings import LARGEST_AUTO, Settings
from agonic.thermal.maths.known_field import (
    KnownFieldEstimate,
    KnownFieldProblem,
    compare_unseen,
    estimate_noise_of,
    find_start,
    leave,
    list_blocks,
    measure_clustering,
    sum_up,
    summarise,
)

BIAS_PER_C, GAIN_PER_C = 5e-4, 1e-3
"""Scales of nature, of the field and of the gain a degree: magnetoresistors and magneto-inductors
without compensation (RM3100, MMC5983, HMC5883L data sheets)."""
SMALLER = 0.3
"""Of an order, the scale of the next."""
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

    def pose(self, degree: int, rate: bool) -> KnownFieldProblem:
        """The problem of an order, with the term in dT/dt or without."""
        phi = build_covariates(self.x, 0.0, degree, self.lag if rate else None)
        return KnownFieldProblem(self.points, self.fields, phi, degree, rate)


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
    """The estimate up to the order that was asked for, or to the last that shows, with
    the lag where it shows or is asked for; and the variance of unseen residuals by order where it
    was looked for."""
    auto = settings.degree == "auto"
    highest = LARGEST_AUTO if settings.degree == "auto" else settings.degree
    curve = None
    if auto:
        curve = _measure_orders(readings, highest, settings.robust)
    problem, estimate, odds = _estimate(readings, highest, settings, auto=auto)
    tests: tuple[ModelTest, ...] = ()
    if readings.lag is not None:
        term = estimate.solution.params[-3:]
        words = readings.scale.describe_lag(term, unit) if problem.rate else NO_LAG
        chance = float(1.0 / (1.0 + np.exp(np.clip(odds, -700.0, 700.0))))
        tests = (
            ModelTest(
                smaller="temperature",
                larger="rate",
                statistic=2.0 * odds,
                p_value=chance,
                sentence=words,
            ),
        )
    return problem, estimate, tests, curve


class _Orders(NamedTuple):
    """The terms that orders and lag form, after the twelve numbers that do not change, and where
    each of these unknowns stands among the coefficients."""

    groups: list[Group]
    places: Index
    highest: int
    lag: int | None

    def find_kept(self, there: set[int]) -> int:
        """The highest order that is there."""
        return max((1 + i // 2 for i in there if i != self.lag), default=0)


def _list_orders(problem: KnownFieldProblem, half_C: float) -> _Orders:
    p, highest = problem.degree + 1, problem.degree
    starts = p * np.arange(12)
    places, groups, at = [starts], list[Group](), 12
    listed = [
        (f"{what} {k}", own + k, per_C * half_C * SMALLER ** (k - 1), ODDS[min(k, len(ODDS)) - 1])
        for k in range(1, highest + 1)
        for what, own, per_C in (
            ("bias", starts[:3], BIAS_PER_C),
            ("matrix", starts[3:], GAIN_PER_C),
        )
    ]
    listed += [("lag", 12 * p + np.arange(3), LAG, ODDS[3])] if problem.rate else []
    for name, own, scale, odds in listed:
        places.append(own)
        groups.append(Group(name, at + np.arange(len(own)), scale, odds, MOST))
        at += len(own)
    lag = len(groups) - 1 if problem.rate else None
    return _Orders(groups, np.concatenate(places), highest, lag)


class _Fitted(NamedTuple):
    """All coefficients, the sizes of the terms that are there, their base, and cross-products."""

    params: Array
    there: dict[int, float]
    base: Base
    gram: Array


def _fit(
    problem: KnownFieldProblem, orders: _Orders, start: Array, weights: Array, noise: Noise | None
) -> _Fitted:
    """Gauss–Newton on the coefficients with the terms that are there; without a noise it is found
    along."""
    params, there = start, dict[int, float]()
    of_axes, n = np.repeat(weights, 3).reshape(-1, 3), 3 * len(weights)
    for _ in range(_STEPS):
        information, gradient, square = sum_up(problem, params, of_axes)
        variance = square / n if noise is None else noise.sd**2 * noise.correlation
        gram = np.empty((len(params) + 1, len(params) + 1))
        own = information[np.ix_(orders.places, orders.places)]
        right = own @ params[orders.places] - gradient[orders.places]
        gram[:-1, :-1], gram[:-1, -1], gram[-1, :-1] = own, right, right
        gram[-1, -1] = square + params[orders.places] @ (2 * right - own @ params[orders.places])
        gram /= max(variance, 1e-24)
        there, base = choose(gram, NONE, orders.groups, there)
        before, params = params, _place(orders, base.columns, base.estimate)
        if float((params - before) @ information @ (params - before)) < _SETTLED * variance:
            break
    return _Fitted(params, there, base, gram)


def _place(orders: _Orders, columns: Index, values: Array) -> Array:
    params = np.zeros(len(orders.places))
    params[orders.places[columns]] = values
    return params


def _estimate(
    readings: KnownFieldReadings, highest: int, settings: Settings, *, auto: bool
) -> tuple[KnownFieldProblem, KnownFieldEstimate, float]:
    """The problem up to an order, its estimate, and the log-odds of the lag.

    Outliers are down-weighted where that foretells unseen readings better: what a model lacks
    (hysteresis, a lag) spoils whole stretches of readings, and to leave those out fits the rest
    only.
    """
    problem = readings.pose(highest, readings.lag is not None)
    orders = _list_orders(problem, readings.scale.half_C)
    weights, count = np.ones(len(readings.x)), 4 * (highest + 1)
    fitted = _fit(problem, orders, find_start(problem), weights, None)
    left = leave(problem, fitted.params)
    noise = estimate_noise_of(left.ravel(), False, count)
    plain = _conclude(problem, orders, readings, settings, fitted.params, weights, noise, auto)
    noise = estimate_noise_of(left.ravel(), settings.robust, count)
    if noise.loss == squares():
        return plain
    for _ in range(_ROUNDS):
        weights = noise.loss.weight((left / noise.sd) ** 2).min(axis=1)
        left = leave(problem, _fit(problem, orders, fitted.params, weights, noise).params)
        before, noise = noise, estimate_noise_of(left.ravel(), True, count)
        if noise.settled(before):
            break
    weighted = _conclude(problem, orders, readings, settings, fitted.params, weights, noise, auto)
    needed = 1.0 - _CLEARLY * measure_clustering(weighted[1].weights)
    unseen = [compare_unseen(one[1], weighted[1]) for one in (weighted, plain)]
    return weighted if unseen[0] < needed * unseen[1] else plain


def _conclude(
    problem: KnownFieldProblem,
    orders: _Orders,
    readings: KnownFieldReadings,
    settings: Settings,
    start: Array,
    weights: Array,
    noise: Noise,
    auto: bool,
) -> tuple[KnownFieldProblem, KnownFieldEstimate, float]:
    """Estimate and covariance averaged over the sizes of all terms, as a calibration has them."""
    _, there, base, gram = _fit(problem, orders, start, weights, noise)
    if orders.lag is not None and settings.rate is True and orders.lag not in there:
        there = {**there, orders.lag: orders.groups[orders.lag].scale}
        base = solve(gram, NONE, orders.groups, there)
    highest = orders.find_kept(set(there)) if auto else orders.highest
    size = len(orders.places)
    found, covariance = np.zeros(size), np.zeros((size, size))
    found[base.columns] = base.estimate
    covariance[np.ix_(base.columns, base.columns)] = base.inverse
    odds = EVIDENCE
    for i, group in enumerate(orders.groups):
        if i in there:
            continue
        one = average(gram, base, group)
        odds = one.odds if i == orders.lag else odds
        stays = i != orders.lag and 1 + i // 2 <= highest
        spread = one.covariance if stays else one.square
        covariance[np.ix_(base.columns, base.columns)] += one.alias @ spread @ one.alias.T
        if stays:
            found[base.columns] -= one.alias @ one.mean
            found[group.columns] = one.mean
            across = -one.alias @ one.covariance
            covariance[np.ix_(group.columns, group.columns)] = one.covariance
            covariance[np.ix_(base.columns, group.columns)] = across
            covariance[np.ix_(group.columns, base.columns)] = across.T
    rate = orders.lag in there
    kept = readings.pose(highest, rate)
    stay = _find_stay(orders, highest, rate)
    params, whole = np.empty(size), np.empty((size, size))
    params[orders.places] = found
    whole[np.ix_(orders.places, orders.places)] = covariance
    known = whole[np.ix_(stay, stay)]
    return kept, summarise(kept, params[stay], known, noise, weights), float(odds)


def _find_stay(orders: _Orders, highest: int, rate: bool) -> Index:
    """Which coefficients a calibration of an order keeps."""
    p = orders.highest + 1
    powers = np.arange(12 * p) % p <= highest
    of_lag = np.full(len(orders.places) - 12 * p, rate)
    return np.flatnonzero(np.concatenate([powers, of_lag]))


def _measure_orders(readings: KnownFieldReadings, highest: int, robust: bool) -> Array:
    """The mean square of what each order (highest + 1,) leaves of blocks that it has not seen, by
    algebra about the fit of all orders."""
    problem = readings.pose(highest, False)
    orders = _list_orders(problem, readings.scale.half_C)
    params = _fit(problem, orders, find_start(problem), np.ones(len(readings.x)), None).params
    left = leave(problem, params)
    noise = estimate_noise_of(left.ravel(), robust, len(params))
    weights = noise.loss.weight((left / noise.sd) ** 2).min(axis=1)
    of_axes = np.repeat(weights, 3).reshape(-1, 3)
    sums = [
        sum_up(problem.select(rows), params, of_axes[rows]) for rows in list_blocks(len(readings.x))
    ]
    whole = [np.sum(part, axis=0) for part in zip(*((one[0], one[1]) for one in sums), strict=True)]
    squares = np.zeros(highest + 1)
    for order in range(highest + 1):
        own = _find_stay(orders, order, False)
        gone = np.setdiff1d(np.arange(len(params)), own)
        for information, gradient, square in sums:
            # the orders above leave the model: their coefficients move to zero
            move = np.zeros(len(params))
            move[gone] = -params[gone]
            rest, pull = whole[0] - information, whole[1] - gradient
            move[own] = -leastsq.inverse(rest[np.ix_(own, own)]) @ (pull + rest @ move)[own]
            squares[order] += square + 2 * gradient @ move + move @ information @ move
    return np.asarray(squares / (3 * float(weights.sum())))
