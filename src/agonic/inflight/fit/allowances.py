"""What residuals hide of the bias, in its standard errors: a drift, the sunlight, a current.

A drift, and a bias that goes with the sunlight in every orbit alike (currents of solar panels,
heat), are terms of the one model, averaged over their size. A current that comes and goes
within minutes follows no spline; without a ground calibration nine numbers take up its mean, and
what is left is correlated in the residuals. The models of the field err for longer, by less, or in
axes that do not turn with the sensor.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import chdtrc, expit

from agonic.arrays import Array, Index, Mask
from agonic.errors import AgonicError
from agonic.health import Finding, figure
from agonic.inflight.fit.covariance import OF_SENSOR, Estimate
from agonic.inflight.fit.pointing import find_eclipse, find_sun_height
from agonic.inflight.fit.problem import Problem
from agonic.inflight.fit.solve import find_start, fit_rows, state_errors
from agonic.inflight.fit.terms import DEGREE
from agonic.maths.estimation.leastsq import Solution, inverse
from agonic.model.average import Base, Group, average
from agonic.model.terms.time import TIME
from agonic.samples import Samples

BIAS_DRIFT = next(term for term in TIME if term.name == "bias drift")
"""What gives a drift, and what goes with the sunlight, its scale."""
LIKELY = 0.1
"""Probability, before the readings are seen, of a drift that unseen blocks do not ask for, and of a
bias that goes with the sunlight."""
SIGNIFICANT = 1e-4
FEWEST = 0.05
"""Share of the record in sunlight, and in shadow, that tells one from the other."""
SHORT_S, SHORTEST_S = 900.0, 60.0
"""A sixth of a low orbit, for errors in the axes of the sensor; for others a minute."""
LARGE = 1e-3
"""Of the field: more than crust and polar currents leave along the field but seldom."""
SHARE = 0.25
"""Of the standard deviation of a residual."""


def allow_for_unseen(problem: Problem, estimate: Estimate) -> tuple[Estimate, list[Finding]]:
    """The estimate with a covariance grown by what its residuals do not show, and what is said.

    Of a record that is fitted in pieces, `problem` holds the rows in memory.
    """
    estimate, found = allow_for_sunlight(problem, allow_for_drift(problem, estimate))
    short = measure_short_error(estimate)
    if short:  # the bias found is that of the mean; at any moment it is off by what is on then
        estimate = _grow(estimate, short**2 * np.eye(3))
        found.append(
            Finding(
                "switching current",
                "check",
                f"residuals contain {figure(short * problem.magnitude)} nT that are correlated "
                f"over minutes, as from a switched current that was not recorded; the standard "
                f"error of the bias includes them",
                "record the currents on board and fit with them (--with), or leave out when they "
                "flowed",
            )
        )
    return estimate, found


def allow_for_drift(problem: Problem, estimate: Estimate) -> Estimate:
    """The estimate averaged over how large its drift is; that of a bias that was chosen to be
    constant grown by the drift that it may have.

    The calibration is that at the end of the record, and so is what the drift adds to it. Nothing
    changes where a number of no intervals was given.
    """
    if estimate.terms.splines:
        drift = _find_columns(estimate, 0, estimate.terms.splines)
        averaged, _ = average_over_size(estimate.solution, drift, 1 - 1e-9)
        return estimate._replace(solution=averaged)
    if 1 not in estimate.held_out:
        return estimate
    fitted = fit_rows(problem, find_start(problem), problem.used, 1)
    other = state_errors(problem, fitted, alternative=True)
    own = _find_columns(other, 0, other.terms.splines)
    found, _ = average_over_size(other.solution, own, LIKELY)
    by = np.kron(np.eye(3), other.terms.last[: other.terms.splines])
    moved = by @ found.params[own]
    return _grow(estimate, np.outer(moved, moved) + by @ found.covariance[np.ix_(own, own)] @ by.T)


def allow_for_sunlight(problem: Problem, estimate: Estimate) -> tuple[Estimate, list[Finding]]:
    """The estimate with the bias' standard errors grown by what the sunlight may do to it.

    Nothing changes where sunlight and shadow cannot be told, or too little of one was seen.
    """
    terms = _list_terms(problem.samples, problem.used)
    if not terms:
        return estimate, []
    samples = problem.samples.with_columns(disturbers={**problem.samples.disturbers, **terms})
    settings = replace(problem.settings, sources=(*problem.settings.sources, *terms))
    lit = replace(problem, samples=samples, settings=settings)
    try:
        intervals = max(estimate.terms.splines - DEGREE + 1, 0)
        fitted = fit_rows(lit, find_start(lit), lit.used, intervals)
        other = state_errors(lit, fitted, alternative=True)
    except AgonicError:  # too few rows for so many terms
        return estimate, []
    count, before = len(terms), estimate.solution
    own = _find_columns(other, other.layout.bias_terms - count, other.layout.bias_terms)
    found, odds = average_over_size(other.solution, own, LIKELY)
    term, mean = other.solution.params[own], found.params
    chi2 = term @ inverse(other.solution.covariance[np.ix_(own, own)]) @ term
    columns = np.stack(list(terms.values()), axis=1)[problem.used] / other.terms.spread[-count:]
    seen = mean[own].reshape(3, count)
    swing = seen @ (columns.T @ columns / len(columns)) @ seen.T
    moved = mean[:3] - before.params[:3]
    size, sd = np.sqrt(np.trace(swing)), np.sqrt(np.diag(before.covariance)[:3].max())
    said = []
    if chdtrc(len(own), chi2) < SIGNIFICANT and size > sd:
        said.append(
            Finding(
                "sunlight",
                "check",
                f"the bias follows the sunlight, by {figure(float(size) * problem.magnitude)} nT "
                "(rms over the record), which its standard error includes",
                "record the currents of the solar panels and the temperature beside the sensor, "
                "and fit with them (--with, --temperature); beside an attitude, check that as well",
            )
        )
    return _grow(estimate, swing + expit(odds) * np.outer(moved, moved)), said


def measure_short_error(estimate: Estimate) -> float:
    """Standard deviation of the short errors of the magnitude over the field; 0 where small."""
    variance = 0.0
    for error in estimate.errors.get("magnitude", ()):
        limit = SHORT_S if error.geometry == OF_SENSOR else SHORTEST_S
        variance += error.variance * (error.time_s < limit)
    sd = float(np.sqrt(variance))
    return sd if sd > max(LARGE, SHARE * estimate.noise["magnitude"].sd) else 0.0


def _list_terms(samples: Samples, used: Mask) -> dict[str, Array]:
    """Sunlight and how high the Sun stands while it shines (n,), each less its mean."""
    eclipse, height = find_eclipse(samples), find_sun_height(samples)
    if eclipse is None or height is None:
        return {}
    share = float(eclipse[used].mean())
    if not FEWEST < share < 1 - FEWEST:
        return {}
    shine = {"sunlight": 1.0 - eclipse, "sun_height": np.where(eclipse, 0.0, height)}
    return {name: values - values[used].mean() for name, values in shine.items()}


def _find_columns(estimate: Estimate, first: int, last: int) -> Index:
    """Where the coefficients of some terms of the bias are among the parameters, axis by axis."""
    numbers = np.arange(estimate.layout.parameters, dtype=np.float64)
    return estimate.layout.biases(numbers)[:, first:last].ravel().astype(np.intp)


def average_over_size(solution: Solution, own: Index, odds: float) -> tuple[Solution, float]:
    """A solution averaged over the size of the term whose coefficients are `own`, at the scale that
    a drift has by nature, and the log-odds that it is there; `odds` those before."""
    information = inverse(solution.covariance)
    right = information @ solution.params
    gram = np.block([[information, right[:, None]], [right, solution.params @ right]])
    others = np.setdiff1d(np.arange(len(right)), own)
    known = inverse(information[np.ix_(others, others)])
    base = Base(others, known, known @ right[others], 0.0)
    term = average(gram, base, Group("", own, BIAS_DRIFT.scale, odds, BIAS_DRIFT.most))
    onto = np.zeros((len(right), len(own)))
    onto[own], onto[others] = np.eye(len(own)), -term.alias
    params, covariance = onto @ term.mean, onto @ term.covariance @ onto.T
    params[others] += base.estimate
    covariance[np.ix_(others, others)] += known
    return solution._replace(params=params, covariance=covariance), term.odds


def _grow(estimate: Estimate, added: Array) -> Estimate:
    """The estimate with so much more variance of the bias, (3, 3)."""
    covariance = estimate.solution.covariance.copy()
    covariance[:3, :3] += added
    return estimate._replace(solution=estimate.solution._replace(covariance=covariance))
