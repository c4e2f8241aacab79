"""What the bias may follow that was not fitted: a drift, the sunlight, the temperature, a current.

Each is a term of the one model: courses over the record that every axis of the bias may follow, of
a size for which nature gives the scale. They share the residuals of one fit by evidence; what each
may do to the bias is in its standard errors. A current that comes and goes within minutes follows
no course; it is correlated in the residuals. The models of the field err for longer, by less, or in
axes that do not turn with the sensor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.special import expit

from agonic.arrays import Array, Index
from agonic.errors import AgonicError
from agonic.field.worldfield import EXTERNAL_NT
from agonic.health import Finding, figure
from agonic.inflight.fit.covariance import OF_SENSOR, Estimate
from agonic.inflight.fit.pointing import find_eclipse, find_sun_height
from agonic.inflight.fit.problem import Problem
from agonic.inflight.fit.solve import fit_rows, state_errors
from agonic.inflight.fit.terms import evaluate_spline, place_knots
from agonic.maths.equation import polynomial
from agonic.maths.estimation.leastsq import Solution, inverse
from agonic.model.average import Group, Prior, average, choose, solve
from agonic.model.terms.time import TIME

BIAS_DRIFT = next(term for term in TIME if term.name == "bias drift")
"""What gives all courses their scale."""
LIKELY = 0.1
"""Probability of each, before the readings are seen; assumed, evidence of 10 to 1 outweighs it."""
CLEAR = 5.0
"""Log-odds from which a course is spoken of, 150 to 1; in the standard error all of them are."""
FEWEST = 0.05
"""Share of the record in sunlight, and in shadow, that tells one from the other."""
SHORT_S, SHORTEST_S = 900.0, 60.0
"""A sixth of a low orbit, for errors in the axes of the sensor; for others a minute."""


class Course(NamedTuple):
    """A row of the table: what the bias may follow, by name.

    `find` gives its columns (n, q), None where the record cannot tell; `move` what helps, "" where
    nothing is said. `at_end`: the bias that is wanted is that at the end of the record, not its
    mean. `as_seen`: only its mean size errs the bias, for most spacecraft have none of it; else its
    mean square does.
    """

    name: str
    find: Callable[[Problem, Estimate], Array | None]
    move: str = ""
    at_end: bool = False
    as_seen: bool = False


def _find_drift(problem: Problem, estimate: Estimate) -> Array | None:
    terms = estimate.terms
    if terms.splines or 1 not in estimate.held_out:  # asked for, or there already
        return None
    return evaluate_spline(problem.time, place_knots(terms.start, terms.stop, 1))


def _find_sunlight(problem: Problem, _: Estimate) -> Array | None:
    """Sunlight, and how high the Sun stands while it shines."""
    eclipse, height = find_eclipse(problem.samples), find_sun_height(problem.samples)
    if eclipse is None or height is None:
        return None
    if not FEWEST < float(eclipse[problem.used].mean()) < 1 - FEWEST:
        return None
    return np.column_stack([1.0 - eclipse, np.where(eclipse, 0.0, height)])


def _find_temperature(problem: Problem, estimate: Estimate) -> Array | None:
    celsius = problem.samples.temperature
    if celsius is None or estimate.terms.degree or not np.ptp(celsius) > 0:
        return None
    over_range = (celsius - celsius.mean()) / np.ptp(celsius)
    return np.column_stack([over_range, (2 * over_range) ** 2])


def _find_bend(problem: Problem, estimate: Estimate) -> Array | None:
    """What the next two powers of temperature are beside those that were fitted."""
    celsius, degree = problem.samples.temperature, estimate.terms.degree
    # the shape of a ground calibration over temperature was told by its chamber
    if celsius is None or not 0 < degree <= problem.settings.temperature_degree:
        return None
    x = 2 * (celsius - celsius.mean()) / np.ptp(celsius)
    beside = np.linalg.qr(polynomial.powers(x, degree + 2))[0][:, degree + 1 :]
    return np.asarray(beside / np.ptp(beside, axis=0))


COURSES = (
    Course("drift", _find_drift, at_end=True),
    Course(
        "sunlight",
        _find_sunlight,
        "record the currents of the solar panels and the temperature beside the sensor, and fit "
        "with them (--with, --temperature); beside an attitude, check that as well",
        as_seen=True,
    ),
    Course(
        "temperature",
        _find_temperature,
        "fit with it (--temperature 1), or start from a calibration over temperature",
    ),
    Course(
        "higher orders of temperature",
        _find_bend,
        "fit with them (a larger --temperature), or start from a calibration over temperature",
    ),
)


def allow_for_unseen(problem: Problem, estimate: Estimate) -> tuple[Estimate, list[Finding]]:
    """The estimate with a covariance grown by what its residuals do not show, and what is said.

    A spline in time is averaged over its size: the calibration is that at the end of the record.
    Of a record that is fitted in pieces, `problem` holds the rows in memory.
    """
    found, unit = [], problem.magnitude
    params, covariance = estimate.solution.params, estimate.solution.covariance.copy()
    if estimate.terms.splines:
        spline = estimate.layout.bias_columns(slice(estimate.terms.splines)).ravel()
        params, covariance = average_over_size(estimate.solution, spline)
    sd = np.sqrt(np.diag(covariance)[:3].max())
    averaged = estimate._replace(solution=estimate.solution._replace(params=params))
    for course, there, size, square in weigh_courses(problem, averaged):
        covariance[:3, :3] += square
        if there and course.move and size > max(sd, 3 * EXTERNAL_NT / unit):  # or the world model's
            what = (
                f"the bias follows the {course.name}, by {figure(size * unit)} nT (rms over the "
                "record), which its standard error includes"
            )
            found.append(Finding(course.name, "check", what, course.move))
    if short := measure_short_error(estimate):
        # the bias found is that of the mean; at any moment it is off by what is on then
        covariance[:3, :3] += short**2 * np.eye(3)
        what = (
            f"residuals contain {figure(short * unit)} nT that are correlated over minutes, as "
            "from a switched current that was not recorded; the standard error of the bias "
            "includes them"
        )
        move = "record the currents on board and fit with them (--with), or leave out when they "
        found.append(Finding("switching current", "check", what, f"{move}flowed"))
    solution = estimate.solution._replace(params=params, covariance=covariance)
    return estimate._replace(solution=solution), found


def weigh_courses(
    problem: Problem, estimate: Estimate
) -> Iterator[tuple[Course, bool, float, Array]]:
    """The courses that the record can tell, whether each is clearly there beside the others, by how
    much the bias was seen to follow it (rms over the field), and the mean square (3, 3) that it
    adds to the error of the bias."""
    used = problem.used
    found = {course: course.find(problem, estimate) for course in COURSES}
    known = {course: x - x[used].mean(axis=0) for course, x in found.items() if x is not None}
    if not known:
        return
    columns = np.hstack([*known.values()])
    if np.count_nonzero(used) <= estimate.layout.parameters + 3 * columns.shape[1]:
        return  # too few readings for so many terms
    named = {f"course_{k}": values for k, values in enumerate(columns.T)}
    beside = problem.with_sources(named, problem.settings.sources)
    try:
        fitted = fit_rows(beside, estimate, used, estimate.terms.intervals)
        other = state_errors(beside, fitted, alternative=True)
    except AgonicError:  # too few rows for so many terms
        return
    columns, first, last = columns[used], -len(named), slice(-len(named), None)
    sizes = np.ones(other.layout.parameters)  # of courses as they are, of a size of about one
    sizes[other.layout.bias_columns(last)] = 1 / other.terms.spread[last]
    covariance = other.solution.covariance * np.outer(sizes, sizes)
    parts = [slice(first, first := first + x.shape[1]) for x in known.values()]
    parts = [slice(part.start, part.stop or None) for part in parts]
    own = [other.layout.bias_columns(part).ravel() for part in parts]
    gram, _, prior, groups = _arrange(other.solution.params * sizes, covariance, own, LIKELY)
    there, _ = choose(gram, prior, groups, {})
    for i, (course, part, group) in enumerate(zip(known, parts, groups, strict=True)):
        term = average(gram, solve(gram, prior, groups, there, i), group)
        x = columns[-1:, part] if course.at_end else columns[:, part]
        seen = term.mean.reshape(3, -1)
        size = float(np.sqrt(np.mean(np.sum((x @ seen.T) ** 2, axis=1))))
        whole = np.outer(term.mean, term.mean) if course.as_seen else term.square
        each = whole.reshape(*seen.shape, *seen.shape)
        square = np.einsum("iajb,na,nb->ij", each, x, x) / len(x)
        moved = float(np.sqrt(expit(term.odds))) * term.alias[:3] @ term.mean
        yield course, i in there and term.odds > CLEAR, size, square + np.outer(moved, moved)


def average_over_size(solution: Solution, own: Index) -> tuple[Array, Array]:
    """Parameters and covariance of a solution averaged over the size of the term whose coefficients
    are `own`."""
    certain = 1 - 1e-9
    gram, order, prior, groups = _arrange(solution.params, solution.covariance, [own], certain)
    base = solve(gram, prior, groups, {})
    term = average(gram, base, groups[0])
    m, onto = len(base.columns), np.vstack([-term.alias, np.eye(len(own))])
    params, covariance = onto @ term.mean, onto @ term.covariance @ onto.T
    params[:m] += base.estimate
    covariance[:m, :m] += base.inverse
    back = np.argsort(order)
    return params[back], covariance[np.ix_(back, back)]


def _arrange(
    params: Array, covariance: Array, own: list[Index], odds: float
) -> tuple[Array, Index, Prior, list[Group]]:
    """Cross-products of a solution with the coefficients of terms last, their order, no prior on
    the others, and the terms as groups."""
    information = inverse(covariance)
    right = information @ params
    others = np.setdiff1d(np.arange(len(right)), np.concatenate(own))
    order = np.concatenate([others, *own])
    gram = np.block([[information, right[:, None]], [right, params @ right]])
    places = np.append(order, len(right))
    stops = len(others) + np.cumsum([len(one) for one in own])
    groups = [
        Group("", np.arange(stop - len(one), stop), BIAS_DRIFT.scale, odds, BIAS_DRIFT.most)
        for one, stop in zip(own, stops, strict=True)
    ]
    m = len(others)
    return gram[np.ix_(places, places)], order, Prior(np.zeros((m, m)), np.zeros(m), 0.0), groups


def measure_short_error(estimate: Estimate) -> float:
    """Standard deviation of the short errors of the magnitude over the field; 0 where small."""
    variance = 0.0
    for error in estimate.errors.get("magnitude", ()):
        limit = SHORT_S if error.geometry == OF_SENSOR else SHORTEST_S
        variance += error.variance * (error.time_s < limit)
    sd = float(np.sqrt(variance))
    seldom = 1e-3  # of the field: crust and polar currents hardly leave more along it
    return sd if sd > max(seldom, 0.25 * estimate.noise["magnitude"].sd) else 0.0
