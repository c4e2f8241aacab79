"""The time constant with which the field of torquers follows their commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from agonic.arrays import Array
from agonic.calibration.sources import parse_source, spell_source
from agonic.calibration.timing import Timing, restore
from agonic.errors import AgonicError
from agonic.inflight.fit.covariance import Estimate
from agonic.inflight.fit.problem import Problem, require_enough
from agonic.inflight.fit.solve import find_estimate
from agonic.inflight.fit.torquers import find_settling_s, is_settling, measure_since_switch
from agonic.maths.estimation.inference import find_move

E_FOLDINGS = 3.0
"""Time constants after which what is left of a switch is no longer seen, about."""
_ROUNDS = 6
_STEP = 0.05


def follow_commands(problem: Problem, estimate: Estimate) -> tuple[Problem, Estimate]:
    """Problem and estimate with a field that follows the torquers among the sources, where that
    takes away what was larger after switches."""
    taken = problem.settings.sources
    commands = tuple(name for name in taken if name in problem.torquers.commands)
    settling_s = _measure_settling_s(problem, estimate) if commands else 0.0
    if not settling_s:
        return problem, estimate
    known = max(estimate.terms.splines - 2, 0)
    plain = replace(problem, settings=replace(problem.settings, drift_knots=known))
    constant_s, sd_s = settling_s / E_FOLDINGS, float("inf")
    try:
        for _ in range(_ROUNDS):
            moved, sd_s = _measure_move(plain, commands, constant_s)
            constant_s += float(np.clip(moved, -constant_s / 2, constant_s))
            if abs(moved) < 0.1 * sd_s:
                break
        followed, again = find_estimate(_follow(problem, commands, constant_s))
    except AgonicError:
        return problem, estimate
    if _measure_settling_s(followed, again) >= settling_s:
        return problem, estimate
    torquers = replace(problem.torquers, time_constant_s=constant_s, time_constant_sd_s=sd_s)
    return replace(followed, torquers=torquers), again


def leave_out_settling(
    problem: Problem, estimate: Estimate, since: Array, step_s: float
) -> Problem:
    """The problem without readings that are taken while torquers settle, where that shows.

    Parameters: `since` (n,) the last switch of a torquer and `step_s` between readings, s.
    """
    settling_s = find_settling_s(since[problem.used], estimate.residuals["magnitude"], step_s)
    within = is_settling(since, settling_s, step_s)
    if not (problem.used & within).any():
        return problem
    left = problem.used & ~within
    require_enough(left)
    count = int((problem.used & within).sum())
    known = replace(problem.torquers, settling_s=settling_s, settling=count)
    return replace(problem, used=left, torquers=known)


def _measure_settling_s(problem: Problem, estimate: Estimate) -> float:
    """How long after a switch of a torquer the residuals are larger than later, s."""
    since = measure_since_switch(problem.samples, problem.torquers.commands)[problem.used]
    step = float(np.median(np.diff(problem.time)))
    return find_settling_s(since, estimate.residuals["magnitude"], step)


def _follow(problem: Problem, commands: Sequence[str], constant_s: float) -> Problem:
    """The problem in which the field follows the commands with a time constant."""
    sources = tuple(
        spell_source(parse_source(one)._replace(time_constant_s=-float(f"{constant_s:.4g}")))
        if one in commands
        else one
        for one in problem.settings.sources
    )
    return replace(problem, settings=replace(problem.settings, sources=sources))


def _measure_move(
    problem: Problem, commands: Sequence[str], constant_s: float
) -> tuple[float, float]:
    """How far the record wants the time constant moved, s, and the standard error."""
    by = _STEP * constant_s
    before, here, after = (
        restore(problem.samples.columns(), dict.fromkeys(commands, Timing(time_constant_s=-one)))
        for one in (constant_s - by, constant_s, constant_s + by)
    )
    parts = {f"{name}_part": here[name] for name in commands}
    slopes = {f"{name}_slope": (after[name] - before[name]) / (2 * by) for name in commands}
    samples = problem.samples.with_columns(
        disturbers={**problem.samples.disturbers, **parts, **slopes}
    )
    others = tuple(one for one in problem.settings.sources if one not in commands)
    settings = replace(problem.settings, sources=(*others, *parts, *slopes))
    _, found = find_estimate(replace(problem, samples=samples, settings=settings))
    return _compare(found, len(commands))


def _compare(found: Estimate, count: int) -> tuple[float, float]:
    """By the last terms of the bias, `count` of the commands and as many slopes."""
    layout, params = found.layout, found.solution.params
    at = layout.biases(np.arange(len(params), dtype=np.float64))[:, -2 * count :].astype(np.intp)
    spread = np.tile(found.terms.spread[-2 * count :], (3, 1))
    terms, slopes = np.split(params[at] / spread, 2, axis=1)
    of_slopes, scale = at[:, count:].ravel(), spread[:, count:].ravel()
    covariance = found.solution.covariance[np.ix_(of_slopes, of_slopes)] / np.outer(scale, scale)
    return find_move(terms.ravel(), slopes.ravel(), covariance)
