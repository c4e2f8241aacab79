"""Sources as terms of the model, and the shape in which they count: the power of a duty, and how a
column goes with its effect.

Values of a grid compete as terms of the model, like sources. One that is surely likelier than the
usual one is refined by fits with the sources x and ∂x/∂θ side by side (`find_move`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np

from agonic.arrays import Array, Mask
from agonic.attitude.problem import (
    Scale,
    Settings,
    estimate_usable,
    find_terms,
    normalise,
    select_usable,
)
from agonic.calibration.sources import (
    list_columns,
    name_sources,
    parse_source,
    spell_source,
)
from agonic.errors import AgonicError
from agonic.maths.equation.affine import SYMMETRIC
from agonic.maths.equation.channels import Problem
from agonic.maths.equation.maximum_likelihood import Estimate
from agonic.maths.estimation.inference import find_move
from agonic.maths.one_pass import median
from agonic.model.average import EVIDENCE, RIVALS
from agonic.model.recorded import Weighed, is_surely_less, measure_slopes, weigh_recorded
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
    """Sets of sources beside the fit with those chosen; None where rows are too few to tell. Rows
    within `margin_s` of either end, which delayed columns do not tell, are left out."""
    problem, scale, found = _fit(log, chosen)
    time, kept = log.samples.time, log.usable
    if time is not None and margin_s > 0.0:
        kept = kept & (time >= time[0] + margin_s) & (time <= time[-1] - margin_s)
        problem = problem.subset(np.flatnonzero(kept[log.usable]))
    columns = [find_terms(log.samples, one)[kept] for one in sets]
    origin = scale.centre / scale.size
    return weigh_recorded(problem, found, None if time is None else time[kept], origin, columns)


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


What = Literal["power", "delay", "time constant"]

POWERS = (1.0, 1.5, 2.0, 2.5, 3.0)
DELAYS_S = (-1.0, -0.5, -0.3, -0.2, -0.1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0, 1.4, 2.0)
"""How late a source may be recorded: current sensors are filtered, outputs are early."""
TIME_CONSTANTS = (-16.0, -8.0, -4.0, -2.0, -1.0, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Time constants, over the step of the rows or 0.1 s, whichever is longer."""
_SHORTEST_S = 0.1
_MOST_STEPS = 4


class Shape(NamedTuple):
    """The power, the delay, s, or the time constant, s, of sources, and its standard error."""

    sources: tuple[str, ...]
    what: What
    value: float
    sd: float

    def describe(self) -> str:
        """The shape in words, after the sources."""
        plain = [
            parse_source(one)._replace(late_s=0.0, time_constant_s=0.0) for one in self.sources
        ]
        named = name_sources([spell_source(one._replace(form="")) for one in plain])
        digits = max(0, 1 - int(np.floor(np.log10(self.sd)))) if self.sd > 0 else 3
        size = f"{abs(self.value):.{digits}f} ± {self.sd:.{digits}f}"
        if self.what == "power":
            return f"{named} enters to the power {size}"
        if self.what == "delay":
            return f"{named} is recorded {size} s {'late' if self.value > 0 else 'early'}"
        if self.value > 0:
            return f"{named} is recorded through a filter with a time constant of {size} s"
        return f"the field follows {named} with a time constant of {size} s"


def find_shapes(
    log: Log, others: tuple[str, ...], sources: tuple[str, ...]
) -> tuple[tuple[str, ...], list[Shape]]:
    """The sources in the shapes that surely suit them better beside `others`, and these shapes."""
    shapes: list[Shape] = []
    kinds_of: list[list[tuple[What, float]]] = []  # first powers, then timings
    parsed = [parse_source(one) for one in sources]
    if all(one.form == "^" for one in parsed):
        kinds_of.append([("power", value) for value in POWERS if value != parsed[0].value])
    if log.samples.time is not None and len(log.samples) > 1:
        kinds_of.append(list_timings(log.samples))
    for kinds in kinds_of:
        found = _find_shape(log, others, sources, kinds)
        if found is not None:
            sources = found.sources
            shapes.append(found)
    return sources, shapes


def list_timings(samples: Samples) -> list[tuple[What, float]]:
    """The delays and time constants that are tried."""
    assert samples.time is not None
    step = max(median(np.diff(samples.time)), _SHORTEST_S)
    delays: list[tuple[What, float]] = [("delay", by) for by in DELAYS_S]
    return [*delays, *(("time constant", step * by) for by in TIME_CONSTANTS)]


def _find_shape(
    log: Log,
    others: tuple[str, ...],
    sources: tuple[str, ...],
    kinds: Sequence[tuple[What, float]],
) -> Shape | None:
    """The likeliest of these shapes, refined, where it surely suits better than the usual one. A
    delay and a filter hardly differ where a load swings: of those that are about as likely once
    refined the first is taken, by the rows that all of them tell."""
    found = _list_likely(log, others, sources, kinds)
    refined = [(what, _refine(log, others, sources, what, value)) for what, value in found]
    refined.sort(key=lambda kind: (kind[0] != "delay", abs(kind[1])))
    if not refined:
        return None
    what, value = refined[0]
    if len(refined) > 1:
        late = max(abs(value) for what, value in kinds if what == "delay")
        sets = [respell(sources, *kind) for kind in refined]
        weighed = weigh_sources(log, others, sets, margin_s=late)
        if weighed is not None:
            what, value = refined[int(np.argmax(weighed.odds > weighed.odds.max() - RIVALS))]
    _, sd = _measure_move(log, others, sources, what, value, white=False) or (0.0, float("inf"))
    return Shape(respell(sources, what, value), what, value, sd)


def _list_likely(
    log: Log,
    others: tuple[str, ...],
    sources: tuple[str, ...],
    kinds: Sequence[tuple[What, float]],
) -> list[tuple[What, float]]:
    """The best of each kind and sign that is surely better than the usual shape, and by half as
    much at least as the best of all."""
    variants = [sources, *(respell(sources, *kind) for kind in kinds)]
    weighed = weigh_sources(log, others, variants)
    if weighed is None:
        return []
    usual, better = weighed.measure_left(0), weighed.odds[1:] - weighed.odds[0]
    least = max(EVIDENCE, float(better.max()) / 2)
    found: dict[tuple[What, bool], tuple[What, float]] = {}
    for i in np.argsort(-better):
        what, value = kinds[i]
        if better[i] > least and (what, value > 0) not in found:
            left = weighed.measure_left(1 + i)
            if is_surely_less(left - usual, len(kinds)):
                found[what, value > 0] = kinds[i]
    return sorted(found.values(), key=kinds.index)


def _refine(
    log: Log, others: tuple[str, ...], sources: tuple[str, ...], what: What, value: float
) -> float:
    """The value near one of the grid that the log determines."""
    reach = 0.5 * abs(value)
    for _ in range(_MOST_STEPS):
        measured = _measure_move(log, others, sources, what, value, white=True)
        if measured is None:
            break
        moved, sd = measured
        nearer = value + float(np.clip(moved, -reach, reach))
        if nearer * value <= 0:  # a filter does not turn into its reverse
            break
        value = nearer
        if abs(moved) < 0.1 * sd:
            break
    return value


def _measure_move(
    log: Log,
    others: tuple[str, ...],
    sources: tuple[str, ...],
    what: What,
    value: float,
    *,
    white: bool,
) -> tuple[float, float] | None:
    """How far the log wants the value moved, and the standard error, for `white` noise or any;
    None where it does not tell."""
    by = 0.02 * abs(value)
    before, there, after = (respell(sources, what, one) for one in (value - by, value, value + by))
    slope = (find_terms(log.samples, after) - find_terms(log.samples, before)) / (2 * by)
    first = find_terms(log.samples, others).shape[1]
    time = None if log.samples.time is None else log.samples.time[log.usable]
    try:
        problem, scale, found = _fit(log, others + there)
        origin, own = scale.centre / scale.size, slope[log.usable]
        measured = measure_slopes(problem, found, time, origin, own, white=white)
    except AgonicError:
        return None
    if measured is None:
        return None
    terms = found.solution.params[problem.basis.shape[1] :].reshape(3, -1) / scale.spread
    return find_move(terms[:, first:].T.ravel(), measured[0].ravel(), measured[1])


def respell(sources: Sequence[str], what: What, value: float) -> tuple[str, ...]:
    """The sources with another power, delay or time constant."""
    part = {"power": "value", "delay": "late_s", "time constant": "time_constant_s"}[what]
    new: dict[str, Any] = {part: float(f"{value:.4g}")}
    return tuple(spell_source(parse_source(one)._replace(**new)) for one in sources)


def find_timing_sd(shapes: Sequence[Shape]) -> dict[str, float]:
    """The standard errors of delays and time constants, s, by column."""
    timed = [one for one in shapes if one.what != "power"]
    return {name: one.sd for one in timed for name in list_columns(one.sources)}
