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
from agonic.inflight.fit.torquers import find_settling_s, is_settling
from agonic.maths.estimation.inference import find_move


def settle_torquers(
    problem: Problem, estimate: Estimate, since: Array, step_s: float, *, follows: bool
) -> tuple[Problem, Estimate]:
    """Problem and estimate with a field that `follows` the torquers among the sources, where that
    takes away what was larger after switches, and without readings that are still off after one.

    Parameters: `since` (n,) seconds since the last switch of a torquer, `step_s` between readings.
    """

    def measure_s(one: Problem, of: Estimate) -> float:
        return find_settling_s(since[one.used], of.residuals["magnitude"], step_s)

    settling_s = measure_s(problem, estimate)
    commands = [one for one in problem.settings.sources if one in problem.torquers.commands]
    if settling_s and follows and commands:
        try:
            followed, again = _follow(problem, estimate, commands, settling_s)
        except AgonicError:
            followed, again = problem, estimate
        left_s = measure_s(followed, again)
        if left_s < settling_s:
            problem, estimate, settling_s = followed, again, left_s
    within = problem.used & is_settling(since, settling_s, step_s)
    if not within.any():
        return problem, estimate
    left = problem.used & ~within
    require_enough(left)
    known = replace(problem.torquers, settling_s=settling_s, settling=int(within.sum()))
    return find_estimate(replace(problem, used=left, torquers=known))


def _follow(
    problem: Problem, estimate: Estimate, commands: Sequence[str], settling_s: float
) -> tuple[Problem, Estimate]:
    """Problem and estimate in which the field follows the commands with a time constant."""
    settings = replace(problem.settings, drift_knots=max(estimate.terms.splines - 2, 0))
    # time constants after which what is left of a switch is no longer seen, about
    constant_s, sd_s = settling_s / 3.0, float("inf")
    for _ in range(6):
        moved, sd_s = _measure_move(replace(problem, settings=settings), commands, constant_s)
        constant_s += float(np.clip(moved, -constant_s / 2, constant_s))
        if abs(moved) < 0.1 * sd_s:
            break
    timed = -float(f"{constant_s:.4g}")
    sources = tuple(
        spell_source(parse_source(one)._replace(time_constant_s=timed)) if one in commands else one
        for one in problem.settings.sources
    )
    torquers = replace(problem.torquers, time_constant_s=constant_s, time_constant_sd_s=sd_s)
    settings = replace(problem.settings, sources=sources)
    return find_estimate(replace(problem, settings=settings, torquers=torquers))


def _measure_move(
    problem: Problem, commands: Sequence[str], constant_s: float
) -> tuple[float, float]:
    """How far the record wants the time constant moved, s, and the standard error: by the commands
    that follow with it, and how these change with it, as sources."""
    by = 0.05 * constant_s
    before, here, after = (
        restore(problem.samples.columns(), dict.fromkeys(commands, Timing(time_constant_s=-one)))
        for one in (constant_s - by, constant_s, constant_s + by)
    )
    parts = {f"{name}_part": here[name] for name in commands}
    slopes = {f"{name}_slope": (after[name] - before[name]) / (2 * by) for name in commands}
    others = tuple(one for one in problem.settings.sources if one not in commands)
    _, found = find_estimate(problem.with_sources(parts | slopes, others))
    count, layout, params = len(commands), found.layout, found.solution.params
    at = layout.bias_columns(slice(-2 * count, None))
    spread = np.tile(found.terms.spread[-2 * count :], (3, 1))
    terms, slope = np.split(params[at] / spread, 2, axis=1)
    own, scale = at[:, count:].ravel(), spread[:, count:].ravel()
    covariance = found.solution.covariance[np.ix_(own, own)] / np.outer(scale, scale)
    return find_move(terms.ravel(), slope.ravel(), covariance)
