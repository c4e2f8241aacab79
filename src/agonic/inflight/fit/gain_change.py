"""Gains that are not those of the ground, which the intervals of a bias otherwise stand in for."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from agonic.health import Finding, figure
from agonic.inflight.fit.bias_step import MANY
from agonic.inflight.fit.drift import DEGREE
from agonic.inflight.fit.solve import find_start, fit_rows

if TYPE_CHECKING:
    from agonic.inflight.fit.problem import Problem
    from agonic.inflight.fit.result import InflightFit

LEAST = 0.005
"""Change of the mean gain from which it is spoken of: what shrinks one axis alone is another."""
HEIGHTS = 0.015
"""Change of the mean gain below which heights may be off instead, by 35 km."""


def find_other_gain(fit: InflightFit, problem: Problem) -> float:
    """The mean gain over that of the ground, with which a constant bias explains the record better
    for its nine numbers than the intervals for theirs; 1 where it does not.

    Akaike's criterion: n log(s/s₀) below the count of numbers that are saved, with n readings that
    count and s, s₀ what is left.
    """
    if problem.ground is None or fit.solve == "full" or fit.drift.intervals < MANY:
        return 1.0
    freed = replace(problem.settings, solve="full")
    plain = replace(problem, ground=None, direction=None, settings=freed)
    constant = fit_rows(plain, find_start(problem), problem.used, 0)
    left = constant.noise["magnitude"].sd * problem.magnitude
    saved = 3 * (fit.drift.intervals + DEGREE - 1) - (6 if fit.solve == "bias" else 3)
    if fit.n / fit.correlation * np.log(left / fit.noise) > saved:
        return 1.0
    return float(np.mean(constant.solution.params[3:6]))


def may_be_heights(gain: float) -> bool:
    """Whether heights that are off by tens of kilometres would do the same: F falls with r³."""
    return abs(gain - 1) < HEIGHTS


def judge_gains(fit: InflightFit, gain: float) -> list[Finding]:
    """That the gains are other than on the ground, by how much."""
    if abs(gain - 1) < LEAST:
        return []
    return [
        Finding(
            "gains changed",
            "check",
            f"gains that are {figure(100 * abs(gain - 1))} % off those of the ground explain the "
            f"record as well as the {fit.drift.intervals} intervals of the bias do",
            "check units and the magnitude that the ground calibration was made for, and heights; "
            'solve for the matrix too (solve="full", --solve full)',
        )
    ]
