"""A recording with what it is fitted by, and its sources as terms of the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.attitude.problem import Scale, estimate_usable, find_terms, normalise, select_usable
from agonic.attitude.settings import Settings
from agonic.calibration.sources import list_columns
from agonic.maths.equation.affine import SYMMETRIC
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.model.recorded import Weighed, measure_slopes, weigh_recorded
from agonic.reference import Reference
from agonic.samples import Samples


class Log(NamedTuple):
    """A recording, what is known of its field, and how it is fitted; the rows that are `usable`.

    `estimates` keeps the fit with each set of sources, for many candidates are tried beside it.
    """

    samples: Samples
    reference: Reference
    settings: Settings
    usable: Mask
    estimates: dict[tuple[str, ...], Estimate]


def weigh_sources(
    log: Log, chosen: tuple[str, ...], sets: Sequence[tuple[str, ...]], margin_s: float = 0.0
) -> Weighed | None:
    """Sets of sources beside the fit with those chosen; None where rows are too few to tell.

    Rows within `margin_s` of either end, which delayed columns do not tell, are left out.
    """
    problem, scale, found = _fit(log, chosen)
    time, kept = log.samples.time, log.usable
    if time is not None and margin_s > 0.0:
        kept = kept & (time >= time[0] + margin_s) & (time <= time[-1] - margin_s)
        problem = problem.subset(np.flatnonzero(kept[log.usable]))
    columns = [find_terms(log.samples, one)[kept] for one in sets]
    origin = scale.centre / scale.size
    return weigh_recorded(problem, found, None if time is None else time[kept], origin, columns)


def measure_slope(
    log: Log, sources: tuple[str, ...], first: int, slopes: Array, *, white: bool
) -> tuple[Array, Array, Array] | None:
    """Of a fit with sources, what those from the `first` on add per unit, (k, 3), and what columns
    (n, k) of all rows add beside them, with its covariance; None where rows are too few."""
    problem, scale, found = _fit(log, sources)
    origin = scale.centre / scale.size
    time = None if log.samples.time is None else log.samples.time[log.usable]
    own = slopes[log.usable]
    measured = measure_slopes(problem, found, time, origin, own, white=white)
    if measured is None:
        return None
    terms = found.solution.params[problem.basis.shape[1] :].reshape(3, -1) / scale.spread
    return terms[:, first:].T, measured[0].reshape(-1, 3), measured[1]


def _fit(log: Log, sources: tuple[str, ...]) -> tuple[Problem, Scale, Estimate]:
    """The problem of the usable rows with sources, its scale, and its estimate."""
    samples, reference, settings, usable, estimates = log
    own = replace(settings, sources=sources)
    problem, scale = normalise(samples, reference, ("magnitude",), SYMMETRIC, own)
    if sources not in estimates:
        start = _find_start(log, sources, problem)
        estimates[sources] = estimate_usable(problem, usable, own, start)
    return select_usable(problem, usable), scale, estimates[sources]


def _find_start(log: Log, sources: tuple[str, ...], problem: Problem) -> Array | None:
    """Parameters of the last fit with the same columns in other shapes, else of that with the most
    of these sources, the others doing nothing; None where nothing is fitted yet."""
    m, among = problem.basis.shape[1], (len(sources), list_columns(sources))
    within, alike = None, None
    for known, found in log.estimates.items():
        if known == sources[: len(known)]:
            within = found.solution.params
        if (len(known), list_columns(known)) == among:
            alike = found.solution.params
    if alike is not None or within is None or problem.terms is None:
        return alike
    terms = within[m:].reshape(3, -1)
    others = np.zeros((3, problem.terms.shape[1] - terms.shape[1]))
    return np.concatenate([within[:m], np.hstack([terms, others]).ravel()])
