"""A bias that goes with the sunlight: currents of solar panels, and heat that nothing recorded.

It repeats in every orbit, so residuals stay small and a bias that is constant, or changes slowly,
takes up a mean of it. That it is there is one model and that it is not another: both are averaged.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, expit

from agonic.arrays import Array, Mask
from agonic.errors import AgonicError
from agonic.inflight.fit.pointing import find_eclipse, find_sun_height
from agonic.inflight.fit.problem import Problem
from agonic.inflight.fit.solve import Estimate, find_start, fit_rows, state_errors
from agonic.model.average import Group, average_estimate
from agonic.model.terms.time import BIAS_DRIFT
from agonic.samples import Samples

LIKELY = 0.1
"""Probability, before the readings are seen, that the bias goes with the sunlight."""
SIGNIFICANT = 1e-4
FEWEST = 0.05
"""Share of the record in sunlight, and in shadow, that tells one from the other."""


class Sunlight(NamedTuple):
    """By how much the bias goes with the sunlight, rms over the record, nT; how often chance does
    so; and the largest standard error of the bias without it, nT."""

    size: float
    p_value: float
    sd: float

    @property
    def sure(self) -> bool:
        """Whether chance does not make it, and it is more than is unknown anyway."""
        return self.p_value < SIGNIFICANT and self.size > self.sd


def allow_for_sunlight(problem: Problem, estimate: Estimate) -> tuple[Estimate, Sunlight | None]:
    """The estimate with the bias' standard errors grown by what the sunlight may do to it.

    Nothing changes where sunlight and shadow cannot be told, or too little of one was seen.
    """
    terms = _list_terms(problem.samples, problem.used)
    if not terms:
        return estimate, None
    samples = problem.samples.with_columns(disturbers={**problem.samples.disturbers, **terms})
    settings = replace(problem.settings, sources=(*problem.settings.sources, *terms))
    lit = replace(problem, samples=samples, settings=settings)
    intervals = max(estimate.terms.splines - 2, 0)
    try:
        fitted = fit_rows(lit, find_start(lit), lit.used, intervals)
        other = state_errors(lit, fitted, alternative=True)
    except AgonicError:  # too few rows for so many terms
        return estimate, None
    return _average(problem, estimate, other, len(terms))


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


def _average(
    problem: Problem, estimate: Estimate, other: Estimate, count: int
) -> tuple[Estimate, Sunlight]:
    """The estimate with a covariance that holds both models, and the test of the terms."""
    params, covariance = other.solution.params, other.solution.covariance
    at = other.layout.biases(np.arange(len(params), dtype=np.float64))[:, -count:]
    own = at.ravel().astype(np.intp)
    term = Group("sunlight", own, BIAS_DRIFT.scale, LIKELY, BIAS_DRIFT.most)
    mean, _, odds, chi2 = average_estimate(params, covariance, term)
    p_value = float(chdtrc(len(own), chi2))
    seen = mean[own].reshape(3, count)
    columns = _evaluate(problem, other, count)
    swing = seen @ (columns.T @ columns / len(columns)) @ seen.T
    moved = mean[:3] - estimate.solution.params[:3]
    grown = estimate.solution.covariance.copy()
    grown[:3, :3] += swing + expit(odds) * np.outer(moved, moved)
    size = float(np.sqrt(np.trace(swing))) * problem.magnitude
    solution = estimate.solution._replace(covariance=grown)
    sd = float(np.sqrt(np.diag(estimate.solution.covariance)[:3].max())) * problem.magnitude
    return estimate._replace(solution=solution), Sunlight(size, p_value, sd)


def _evaluate(problem: Problem, other: Estimate, count: int) -> Array:
    """The terms of the sunlight as the fit took them (n, count), of the rows used."""
    terms = _list_terms(problem.samples, problem.used)
    values = np.stack(list(terms.values()), axis=1)[problem.used]
    return np.asarray(values / other.terms.spread[-count:])
