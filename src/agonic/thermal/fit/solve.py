"""The joint estimate: which terms it has, and whether the described orientations hold."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from agonic.arrays import Array
from agonic.fit import ModelTest
from agonic.health import figure
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import estimate
from agonic.maths.estimation.leastsq import inverse
from agonic.thermal.fit.each_temperature import (
    FEWEST,
    EachTemperature,
    choose_degree,
    fit_each_temperature,
)
from agonic.thermal.fit.problem import NO_LAG, ChamberReadings, Settings, make_problem
from agonic.thermal.maths.estimate import (
    StationEstimate,
    estimate_by_magnitude,
    estimate_by_orientations,
)
from agonic.thermal.maths.fault_terms import PLAUSIBLE
from agonic.thermal.maths.station_faults import (
    Faults,
    find_faults,
    measure_shown_change,
)
from agonic.thermal.maths.station_residuals import StationProblem, find_directions
from agonic.thermal.maths.stations import find_mistake, find_mounting

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
    """What the described orientations are worth: whether the readings agree, their misfit, and the
    stations that explain it: two that were exchanged, or one that stood elsewhere; `left_deg` is
    the misfit that is left then."""

    agree: bool
    rms_deg: float
    mistaken: tuple[int, ...] = ()
    left_deg: float = np.nan


class Solution(NamedTuple):
    """The joint estimate with its problem, tests of terms, and what the orientations are worth.

    `drifts` is whether the field surely drifted, or was said to; `aged` whether the bias did;
    `faults` is what was not the same at all stations, which the covariance contains; `unseen` the
    covariance (a, a) of a plausible change between stations that the magnitude alone does not show,
    which it does not.
    """

    estimate: StationEstimate
    problem: StationProblem
    separate: EachTemperature
    tests: tuple[ModelTest, ...]
    orientations: Orientations | None
    drifts: bool
    aged: bool
    faults: Faults
    unseen: Array

    @property
    def unwatched(self) -> StationEstimate:
        """The estimate as sure as it is in a field that nobody watched between stations."""
        whole = self.estimate
        return whole._replace(covariance=whole.covariance + self.unseen)


class _Term(NamedTuple):
    """The test of a further term, and whether it is sure and large enough to be kept."""

    test: ModelTest
    kept: bool


def solve(readings: ChamberReadings, settings: Settings) -> Solution:
    """The most probable coefficients of all temperatures and stations at once."""
    drift = settings.drift is not False and bool(np.isfinite(readings.cells.time).all())
    rate = settings.rate is not False and _changes_both_ways(readings)

    def estimate_first(degree: int) -> tuple[StationProblem, StationEstimate]:
        problem = make_problem(readings, degree, settings, rate=rate, drift=drift)
        return problem, estimate_by_magnitude(problem, find_start(problem))

    problem, first = estimate_first(3 if settings.degree == "auto" else settings.degree)
    if settings.degree == "auto":
        separate = fit_each_temperature(readings, problem, first.coefficients)
        degree = choose_degree(separate, readings)
        if degree != problem.degree:
            problem, first = estimate_first(degree)
    problem, orientations = _add_orientations(readings, problem, first, settings)
    whole = first if problem.rot_nb is None else _estimate(problem, first, first.coefficients)
    lag = _test_rate(readings, problem, whole)
    if lag is not None and settings.rate is not True and not lag.kept:
        problem = problem._replace(phi=problem.phi[:, :-1], rate=False)
        whole = _estimate(problem, whole, whole.coefficients[:-3])
    drifting, ageing = _test_trends(readings, whole)
    # what is left of a thermometer's noise looks like small faults
    look = settings.faults and not readings.thermometer_C
    changed = 0.0
    if not problem.turns_known:
        changed = max(settings.unseen_change_sd, measure_shown_change(whole))
    faults = find_faults(problem, whole, readings.cells.time, (changed, PLAUSIBLE), look)
    allowed, unseen = faults.unseen
    return Solution(
        estimate=whole._replace(
            coefficients=faults.coefficients,
            covariance=faults.covariance + allowed,
        ),
        problem=problem,
        separate=fit_each_temperature(readings, problem, whole.coefficients),
        tests=tuple(term.test for term in (lag, drifting, ageing) if term is not None),
        orientations=orientations,
        drifts=problem.drifting or (drifting is not None and drifting.kept),
        aged=ageing is not None and ageing.kept,
        faults=faults,
        unseen=unseen,
    )


def find_start(problem: StationProblem) -> Array:
    """Coefficients that do not change with temperature, from the stations' means at the middle."""
    x = problem.phi[:, 1] if problem.degree else np.zeros(len(problem.points))
    middle = np.argsort(np.abs(x))[: max(int((np.abs(x) < _MIDDLE).sum()), 2 * problem.stations)]
    rows = middle if problem.degree else np.arange(len(problem.points))
    points = np.array(
        [
            problem.points[rows[problem.station[rows] == k]].mean(axis=0)
            for k in np.unique(problem.station[rows])
        ]
    )
    found = estimate(Problem(points, np.ones(1), "full", problem.soft_iron_sd), robust=False)
    coefficients = np.zeros((9, problem.degree + 1))
    coefficients[:, 0] = found.solution.params
    return np.concatenate([coefficients.ravel(), np.zeros(3 if problem.rate else 0)])


def _changes_both_ways(readings: ChamberReadings) -> bool:
    """Whether the rate is known and its effect can be told from that of the temperature."""
    cells = readings.cells
    if not np.isfinite(cells.time).all() or not np.any(cells.rate):
        return False
    return bool(
        (cells.n[cells.heating].sum() > 0.1 * cells.n.sum())
        and (cells.n[~cells.heating].sum() > 0.1 * cells.n.sum())
    )


def _add_orientations(
    readings: ChamberReadings,
    problem: StationProblem,
    first: StationEstimate,
    settings: Settings,
) -> tuple[StationProblem, Orientations | None]:
    """The problem with the described orientations, where the readings do not contradict them."""
    described = settings.orientations
    if settings.stations == "found" and len(readings.numbers) >= FEWEST:
        seen = find_directions(problem, first.coefficients)
        return problem.with_found_turns(seen), None
    if described is None or any(number not in described for number in readings.numbers):
        return problem, None
    rot_nb = np.array([described[number] for number in readings.numbers])
    seen = find_directions(problem, first.coefficients)
    rms = float(np.degrees(find_mounting(seen, rot_nb).rms))
    limit = MISFIT_DEG if len(readings.numbers) >= FEWEST else _MISFIT_FEW_DEG
    limit = max(limit, 4 * settings.fixture_sd_deg)
    if rms > limit:
        stations, left = find_mistake(seen, rot_nb)
        left_deg = float(np.degrees(left))
        explains = left_deg < min(_BETTER * rms, limit)
        mistaken = tuple(readings.numbers[k] for k in stations) if explains else ()
        return problem, Orientations(False, rms, mistaken, left_deg)
    problem = problem._replace(
        rot_nb=rot_nb,
        fixture_sd=float(np.radians(settings.fixture_sd_deg)),
        fixture_known=settings.fixture_known,
    )
    return problem, Orientations(True, rms)


def _estimate(problem: StationProblem, before: StationEstimate, start: Array) -> StationEstimate:
    if problem.rot_nb is None:
        return estimate_by_magnitude(problem, start)
    return estimate_by_orientations(problem, start, before.slow)


def _test_rate(
    readings: ChamberReadings, problem: StationProblem, whole: StationEstimate
) -> _Term | None:
    """Whether the bias depends on how fast the temperature changes.

    A rate that goes unseen hardly moves the others, for all temperatures were cooled and heated
    through; it is decided upon. A drift would move them: it is averaged (`model.average`).
    """
    if not problem.rate:
        return None
    term = whole.coefficients[-3:]  # at the usual rate, over the field
    said = readings.scale.describe_lag(term, readings.unit)
    return _test_term(term, whole.covariance[-3:, -3:], ("temperature", "rate"), said, NO_LAG)


def _test_trends(
    readings: ChamberReadings, whole: StationEstimate
) -> tuple[_Term | None, _Term | None]:
    """Whether the chamber's field changed steadily, and the bias of the sensor in its own axes."""
    scale, unit = readings.scale, readings.unit
    known = (scale.magnitude, "nT") if scale.magnitude else (scale.size, unit)
    drift, ageing = (
        _test_term(
            term,
            covariance,
            ("constant", name),
            f"{what} changed by {figure(float(np.linalg.norm(term)) * size)} {unit} from the first "
            "reading to the last",
            f"no sign that {what} changed steadily",
        )
        if len(term)
        else None
        for name, what, term, covariance, (size, unit) in (
            ("drift", "the chamber's field", whole.drift, whole.drift_covariance, known),
            ("ageing", "the bias", whole.ageing, whole.ageing_covariance, (scale.size, unit)),
        )
    )
    return drift, ageing


def _test_term(
    term: Array, covariance: Array, models: tuple[str, str], said: str, otherwise: str
) -> _Term:
    """Wald's test that a normalised term is zero."""
    statistic = float(term @ inverse(covariance) @ term)
    p_value = float(chdtrc(len(term), statistic))
    kept = p_value < SIGNIFICANT and float(np.linalg.norm(term)) > LEAST
    test = ModelTest(
        smaller=models[0],
        larger=models[1],
        statistic=statistic,
        p_value=p_value,
        sentence=said if kept else otherwise,
    )
    return _Term(test, kept)
