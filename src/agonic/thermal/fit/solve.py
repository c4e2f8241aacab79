"""The joint refinement: which terms it has, and whether the described turns can be believed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from agonic.arrays import Array
from agonic.fit import ModelTest
from agonic.health import figure
from agonic.maths.equation import likelihood
from agonic.maths.estimation.leastsq import inverse
from agonic.thermal.fit import each_temperature as bins
from agonic.thermal.fit.problem import ChamberReadings, make_problem
from agonic.thermal.fit.settings import Settings
from agonic.thermal.maths import estimate as chamber
from agonic.thermal.maths import fixture, station_residuals
from agonic.thermal.maths.ellipsoids import FEWEST

SIGNIFICANT = 1e-4
"""A term is kept when chance would make it this seldom."""
LEAST = 2e-4
"""… and when it is more than this of the field: what no compass notices is not worth a term."""
MISFIT_DEG = 4.0
"""Directions that are further from the described turns than this, rms, contradict them."""
_MISFIT_FEW_DEG = 15.0
_BETTER = 0.4
_MIDDLE = 0.15  # of the half range: cells that start the search


class Orientations(NamedTuple):
    """What the described turns are worth: believed or not, their misfit, and a likely exchange."""

    believed: bool
    rms_deg: float
    exchange: tuple[int, int] | None = None
    exchanged_rms_deg: float = np.nan


class Solution(NamedTuple):
    """The joint estimate with its problem, tests of terms, and what the turns are worth."""

    estimate: chamber.StationEstimate
    problem: station_residuals.StationProblem
    separate: bins.EachTemperature
    tests: tuple[ModelTest, ...]
    turns: Orientations | None

    @property
    def drifts(self) -> bool:
        """Whether the field surely drifted, or was said to."""
        return self.problem.drifting or any(
            test.larger == "drift" and _is_kept(test) for test in self.tests
        )


def solve(of: ChamberReadings, settings: Settings) -> Solution:
    """The most probable coefficients of all temperatures and stations at once."""
    drift = settings.drift is not False and bool(np.isfinite(of.cells.time).all())
    rate = settings.rate is not False and _changes_both_ways(of)
    degree = 3 if settings.degree == "auto" else settings.degree
    posed = make_problem(
        of,
        degree,
        rate=rate,
        drift=drift,
        sure=settings.drift is True,
        soft_iron_sd=settings.soft_iron_sd,
    )
    first = chamber.estimate_by_magnitude(posed, find_start(posed))
    if settings.degree == "auto":
        degree = bins.choose_degree(bins.fit_each_temperature(of, posed, first.coefficients), of)
        if degree != posed.degree:
            posed = make_problem(
                of,
                degree,
                rate=rate,
                drift=drift,
                sure=settings.drift is True,
                soft_iron_sd=settings.soft_iron_sd,
            )
            first = chamber.estimate_by_magnitude(posed, find_start(posed))
    posed, turns = _add_orientations(of, posed, first, settings)
    best, posed, tests = _choose_terms(of, posed, first, settings)
    separate = bins.fit_each_temperature(of, posed, best.coefficients)
    return Solution(best, posed, separate, tests, turns)


def find_start(posed: station_residuals.StationProblem) -> Array:
    """Coefficients that do not change with temperature, from the stations' means at the middle."""
    x = posed.phi[:, 1] if posed.degree else np.zeros(len(posed.points))
    middle = np.argsort(np.abs(x))[: max(int((np.abs(x) < _MIDDLE).sum()), 2 * posed.stations)]
    rows = middle if posed.degree else np.arange(len(posed.points))
    points = np.array(
        [
            posed.points[rows[posed.station[rows] == k]].mean(axis=0)
            for k in np.unique(posed.station[rows])
        ]
    )
    found = likelihood.estimate(
        likelihood.Problem(points, np.ones(1), "full", posed.soft_iron_sd), robust=False
    )
    coefficients = np.zeros((9, posed.degree + 1))
    coefficients[:, 0] = found.solution.params
    return np.concatenate([coefficients.ravel(), np.zeros(3 if posed.rate else 0)])


def _changes_both_ways(of: ChamberReadings) -> bool:
    """Whether the rate is known and its effect can be told from that of the temperature."""
    cells = of.cells
    if not np.isfinite(cells.time).all() or not np.any(cells.rate):
        return False
    return bool(
        (cells.n[cells.heating].sum() > 0.1 * cells.n.sum())
        and (cells.n[~cells.heating].sum() > 0.1 * cells.n.sum())
    )


def _add_orientations(
    of: ChamberReadings,
    posed: station_residuals.StationProblem,
    first: chamber.StationEstimate,
    settings: Settings,
) -> tuple[station_residuals.StationProblem, Orientations | None]:
    """The problem with the described turns, where the readings do not contradict them."""
    described = settings.turns
    if described is None or any(number not in described for number in of.numbers):
        return posed, None
    rot_nb = np.array([described[number] for number in of.numbers])
    seen = station_residuals.find_directions(posed, first.coefficients)
    rms = float(np.degrees(fixture.find_mounting(seen, rot_nb).rms))
    limit = MISFIT_DEG if len(of.numbers) >= FEWEST else _MISFIT_FEW_DEG
    if rms > max(limit, 4 * settings.fixture_sd_deg):
        swap = fixture.find_exchange(seen, rot_nb)
        left = float(np.degrees(swap.rms))
        pair = (of.numbers[swap.first], of.numbers[swap.second])
        return posed, Orientations(False, rms, pair if left < _BETTER * rms else None, left)
    posed = posed._replace(
        rot_nb=rot_nb,
        fixture_sd=float(np.radians(settings.fixture_sd_deg)),
        fixture_known=settings.fixture_known,
    )
    return posed, Orientations(True, rms)


def _estimate(
    posed: station_residuals.StationProblem, before: chamber.StationEstimate, start_at: Array
) -> chamber.StationEstimate:
    if posed.rot_nb is None:
        return chamber.estimate_by_magnitude(posed, start_at)
    return chamber.estimate_by_orientations(posed, start_at, before.slow)


def _choose_terms(
    of: ChamberReadings,
    posed: station_residuals.StationProblem,
    first: chamber.StationEstimate,
    settings: Settings,
) -> tuple[chamber.StationEstimate, station_residuals.StationProblem, tuple[ModelTest, ...]]:
    """The estimate with the term in the rate where the readings ask for it.

    A rate that goes unseen hardly moves the others, for all temperatures were cooled and heated
    through; it is decided upon. A drift would move them: it is averaged (`model_averaging`).
    """
    whole = first if posed.rot_nb is None else _estimate(posed, first, first.coefficients)
    test = _test_rate(of, posed, whole)
    if test is not None and settings.rate is not True and not _is_kept(test):
        posed = posed._replace(phi=posed.phi[:, :-1], rate=False)
        whole = _estimate(posed, whole, whole.coefficients[:-3])
    tests = (test, _test_drift(of, posed, whole))
    return whole, posed, tuple(each for each in tests if each is not None)


def _is_kept(test: ModelTest) -> bool:
    return test.p_value < SIGNIFICANT and not test.sentence.startswith("no ")


def _test_rate(
    of: ChamberReadings, posed: station_residuals.StationProblem, whole: chamber.StationEstimate
) -> ModelTest | None:
    """Wald's test that the bias does not depend on how fast the temperature changes."""
    if not posed.rate:
        return None
    term, spread = whole.coefficients[-3:], whole.covariance[-3:, -3:]
    statistic = float(term @ inverse(spread) @ term)
    p_value = float(chdtrc(3, statistic))
    size = float(np.linalg.norm(term))  # at the usual rate, over the field
    there = p_value < SIGNIFICANT and size > LEAST
    words = (
        f"the bias lags by {figure(size * of.scale.size)} {of.unit} while the temperature changes "
        f"at {figure(of.scale.pace * 60)} °C/min"
        if there
        else "no sign that the bias depends on how fast the temperature changes"
    )
    return ModelTest(
        smaller="temperature", larger="rate", statistic=statistic, p_value=p_value, sentence=words
    )


def _test_drift(
    of: ChamberReadings, posed: station_residuals.StationProblem, whole: chamber.StationEstimate
) -> ModelTest | None:
    """Wald's test that the chamber's field stayed the same."""
    if posed.pace is None:
        return None
    statistic = float(whole.drift @ inverse(whole.drift_covariance) @ whole.drift)
    p_value = float(chdtrc(len(whole.drift), statistic))
    size = float(np.linalg.norm(whole.drift))
    there = p_value < SIGNIFICANT and size > LEAST
    amount = figure(size * (of.scale.magnitude or of.scale.size))
    unit = of.unit if of.scale.magnitude is None else "nT"
    words = (
        f"the chamber's field changed by {amount} {unit} from the first reading to the last"
        if there
        else "no sign that the chamber's field changed steadily"
    )
    return ModelTest(
        smaller="constant", larger="drift", statistic=statistic, p_value=p_value, sentence=words
    )
