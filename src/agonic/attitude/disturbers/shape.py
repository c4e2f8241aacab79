"""The shape in which sources count: the power of a duty, and how a column goes with its effect.

Values of a grid compete as terms of the model, like sources. One that is surely likelier than the
usual one is refined by fits with the sources x and ∂x/∂θ side by side (`find_move`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from agonic.attitude.disturbers.log import Log, measure_slope, weigh_sources
from agonic.attitude.problem import find_terms
from agonic.calibration.sources import (
    Source,
    list_columns,
    name_sources,
    parse_source,
    spell_source,
)
from agonic.errors import AgonicError
from agonic.maths.estimation.shape import find_move
from agonic.maths.one_pass import median
from agonic.model.average import EVIDENCE, RIVALS
from agonic.model.recorded import is_surely_less
from agonic.samples import Samples

What = Literal["power", "delay", "time constant"]

POWERS = (1.0, 1.5, 2.0, 2.5, 3.0)
DELAYS_S = (-1.0, -0.5, -0.3, -0.2, -0.1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0, 1.4, 2.0)
"""How late a source may be recorded: current sensors are filtered, outputs are early."""
TIME_CONSTANTS = (-16.0, -8.0, -4.0, -2.0, -1.0, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Time constants, over the step of the rows or 0.1 s, whichever is longer."""
_SHORTEST_S = 0.1
_ROUNDS = 4


class Shape(NamedTuple):
    """The power, the delay, s, or the time constant, s, of sources, and its standard error."""

    sources: tuple[str, ...]
    what: What
    value: float
    sd: float

    def describe(self) -> str:
        """The shape in words, after the sources.

        >>> Shape(("current_A@0.2",), "delay", 0.2, 0.01).describe()
        'current_A is recorded 0.200 ± 0.010 s late'
        """
        plain = [
            parse_source(one)._replace(late_s=0.0, time_constant_s=0.0) for one in self.sources
        ]
        named = name_sources([spell_source(one._replace(form="")) for one in plain])
        digits = max(0, 1 - int(np.floor(np.log10(self.sd)))) if self.sd > 0 else 3
        size = f"{abs(self.value):.{digits}f} ± {self.sd:.{digits}f}"
        if self.what == "power":
            return f"{named} counts to the power {size}"
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
    for kinds in _list_kinds(log.samples, sources):
        found = _find_shape(log, others, sources, kinds)
        if found is not None:
            sources = found.sources
            shapes.append(found)
    return sources, shapes


def _list_kinds(samples: Samples, sources: Sequence[str]) -> list[list[tuple[What, float]]]:
    """What is compared with the usual shape: first powers, then timings."""
    kinds: list[list[tuple[What, float]]] = []
    parsed = [parse_source(one) for one in sources]
    if all(one.form == "^" for one in parsed):
        kinds.append([("power", value) for value in POWERS if value != parsed[0].value])
    if samples.time is not None and len(samples) > 1:
        kinds.append(_list_timings(samples))
    return kinds


def list_timings(samples: Samples, sources: tuple[str, ...]) -> list[tuple[str, ...]]:
    """The sources in all their timings."""
    return [_respell(sources, *one) for one in _list_timings(samples)]


def _list_timings(samples: Samples) -> list[tuple[What, float]]:
    step = find_step_s(samples)
    delays: list[tuple[What, float]] = [("delay", by) for by in DELAYS_S]
    return [*delays, *(("time constant", step * by) for by in TIME_CONSTANTS)]


def find_step_s(samples: Samples) -> float:
    """The step of time constants, s: that of the rows, or 0.1 s where that is longer."""
    assert samples.time is not None
    return max(median(np.diff(samples.time)), _SHORTEST_S)


def _find_shape(
    log: Log,
    others: tuple[str, ...],
    sources: tuple[str, ...],
    kinds: Sequence[tuple[What, float]],
) -> Shape | None:
    """The likeliest of these shapes, refined, where it surely suits better than the usual one.

    A delay and a filter hardly differ where a load swings: of those that are about as likely once
    refined the first is taken, by the rows that all of them tell.
    """
    found = _list_likely(log, others, sources, kinds)
    refined = [(what, _refine(log, others, sources, what, value)) for what, value in found]
    refined.sort(key=lambda kind: (kind[0] != "delay", abs(kind[1])))
    if not refined:
        return None
    what, value = refined[0]
    if len(refined) > 1:
        late = max(abs(value) for what, value in kinds if what == "delay")
        sets = [_respell(sources, *kind) for kind in refined]
        weighed = weigh_sources(log, others, sets, margin_s=late)
        if weighed is not None:
            what, value = refined[int(np.argmax(weighed.odds > weighed.odds.max() - RIVALS))]
    _, sd = _measure_move(log, others, sources, what, value, white=False) or (0.0, float("inf"))
    return Shape(_respell(sources, what, value), what, value, sd)


def _list_likely(
    log: Log,
    others: tuple[str, ...],
    sources: tuple[str, ...],
    kinds: Sequence[tuple[What, float]],
) -> list[tuple[What, float]]:
    """The best of each kind and sign that is surely better than the usual shape, and by half as
    much at least as the best of all."""
    variants = [sources, *(_respell(sources, *kind) for kind in kinds)]
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
    for _ in range(_ROUNDS):
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
    before, there, after = (_respell(sources, what, one) for one in (value - by, value, value + by))
    slope = (find_terms(log.samples, after) - find_terms(log.samples, before)) / (2 * by)
    first = find_terms(log.samples, others).shape[1]
    try:
        measured = measure_slope(log, others + there, first, slope, white=white)
    except AgonicError:
        return None
    if measured is None:
        return None
    terms, slopes, covariance = measured
    return find_move(terms.ravel(), slopes.ravel(), covariance)


def _respell(sources: Sequence[str], what: What, value: float) -> tuple[str, ...]:
    """The sources with another power, delay or time constant."""
    return tuple(spell_source(_reshape(parse_source(one), what, value)) for one in sources)


def _reshape(source: Source, what: What, value: float) -> Source:
    value = float(f"{value:.4g}")
    if what == "power":
        return source._replace(value=value)
    return (
        source._replace(late_s=value) if what == "delay" else source._replace(time_constant_s=value)
    )


def find_timing_sd(shapes: Sequence[Shape]) -> dict[str, float]:
    """The standard errors of delays and time constants, s, by column."""
    timed = [one for one in shapes if one.what != "power"]
    return {name: one.sd for one in timed for name in list_columns(one.sources)}
