"""The estimate from the rows of a log that can be used."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import numpy as np

from agonic.arrays import Array, Mask
from agonic.attitude.settings import Settings
from agonic.errors import CoverageError
from agonic.health import FEWEST
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import Estimate, estimate, refine


def estimate_usable(
    problem: Problem, usable: Mask, settings: Settings, start: Array | None = None
) -> Estimate:
    """The estimate from the usable rows of a problem of all rows; from `start` first, if given."""
    part = select_usable(problem, usable)
    with name_missing_hold():
        return estimate(part, robust=is_robust(part, settings), seed=settings.seed, start=start)


def estimate_beside(
    known: Mapping[tuple[str, ...], Estimate], problem: Problem, usable: Mask, settings: Settings
) -> Estimate:
    """The estimate with the sources of the settings: the one `known`, or else sought first from the
    one with most of the first of them, of which the others add nothing."""
    sources = settings.sources
    if sources in known:
        return known[sources]
    fewer = [sources[:k] for k in range(len(sources)) if sources[:k] in known]
    if not fewer or problem.terms is None:
        return estimate_usable(problem, usable, settings)
    before, own = known[fewer[-1]].solution.params, problem.basis.shape[1]
    slopes = before[own:].reshape(3, -1)
    more = problem.terms.shape[1] - slopes.shape[1]
    start = np.concatenate([before[:own], np.pad(slopes, ((0, 0), (0, more))).ravel()])
    return estimate_usable(problem, usable, settings, start)


def refine_usable(problem: Problem, usable: Mask, settings: Settings, params: Array) -> Estimate:
    """The same from near parameters, and nowhere else."""
    part = select_usable(problem, usable)
    with name_missing_hold():
        return refine(part, params, is_robust(part, settings))


@contextmanager
def name_missing_hold() -> Iterator[None]:
    """The error of a fit that runs away."""
    try:
        yield
    except (OverflowError, np.linalg.LinAlgError):
        raise CoverageError(
            "the readings do not determine a calibration: an axis never moves, or says what "
            "another does",
            turns="look at each axis of the log, and turn the sensor about all three",
        ) from None


def select_usable(problem: Problem, usable: Mask) -> Problem:
    """The problem of the usable rows (n,)."""
    return problem if usable.all() else problem.subset(np.flatnonzero(usable))


def is_robust(part: Problem, settings: Settings) -> bool:
    """Whether outliers are down-weighted, which few rows do not allow."""
    return settings.robust and len(part.points) >= 2 * FEWEST
