"""The estimate from the rows of a log that can be used."""

from __future__ import annotations

from collections.abc import Iterator
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
