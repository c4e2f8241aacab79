"""The shape in which sources count: the power of a duty, and how a column goes with its effect.

Values of a grid are compared on blocks of time that were not fitted, like sources. One that surely
leaves less than the usual one is refined by fits with the sources x and ∂x/∂θ side by side
(`find_move`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np
from scipy.special import stdtrit

from agonic.arrays import Array
from agonic.attitude.disturbers.block_sums import BLOCKS, MOST_ROWS, Log, sum_blocks
from agonic.attitude.fit import fit_channels_alone
from agonic.attitude.problem import find_terms
from agonic.calibration.affine import Affine
from agonic.calibration.interference import Interference
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
from agonic.samples import Samples

What = Literal["power", "delay", "time constant"]

CHANCE = 0.05
"""How often another shape than the usual one may be taken where that is the true one."""
POWERS = (1.0, 1.5, 2.0, 2.5, 3.0)
DELAYS_S = (-0.3, -0.2, -0.1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
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
        step = find_step_s(samples)
        delays: list[tuple[What, float]] = [("delay", by) for by in DELAYS_S]
        kinds.append([*delays, *(("time constant", step * by) for by in TIME_CONSTANTS)])
    return kinds


def list_followed(samples: Samples, sources: tuple[str, ...]) -> list[tuple[str, ...]]:
    """The sources where the field follows them slowly, with several time constants."""
    step = find_step_s(samples)
    return [_respell(sources, "time constant", step * by) for by in TIME_CONSTANTS if by < -1.0]


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
    """The best of these shapes, refined, where it is surely better than the one there is."""
    variants = [sources, *(_respell(sources, *kind) for kind in kinds)]
    sums = sum_blocks(log, others, variants)
    left = np.stack([np.log(sums.measure((one,))) for one in variants])
    best = int(np.argmin(left.mean(axis=1)))
    better = left[0] - left[best]
    surely = float(stdtrit(BLOCKS - 1, 1.0 - CHANCE / len(kinds)))
    if not better.mean() > surely * better.std(ddof=1) / np.sqrt(BLOCKS):
        return None
    return _refine(log, others, sources, *kinds[best - 1])


def _refine(
    log: Log, others: tuple[str, ...], sources: tuple[str, ...], what: What, value: float
) -> Shape:
    """The shape near one of the grid that the log determines, with its standard error."""
    sd, reach, near = float("inf"), 0.5 * abs(value), None
    for _ in range(_ROUNDS):
        try:
            moved, sd, near = _measure_move(log, others, sources, what, value, near)
        except AgonicError:
            break
        nearer = value + float(np.clip(moved, -reach, reach))
        if nearer * value <= 0:  # a filter does not turn into its reverse
            break
        value = nearer
        if abs(moved) < 0.1 * sd:
            break
    return Shape(_respell(sources, what, value), what, value, sd)


def _measure_move(
    log: Log,
    others: tuple[str, ...],
    sources: tuple[str, ...],
    what: What,
    value: float,
    near: Affine | None,
) -> tuple[float, float, Affine]:
    """How far the log wants the value moved, the standard error, and the fit that tells, which is
    sought from the one `near` a value before, or else from the fit with the others alone."""
    by = 0.02 * abs(value)
    there, before, after = (
        find_terms(log.samples, _respell(sources, what, one))
        for one in (value, value - by, value + by)
    )
    known = dict(log.samples.disturbers)
    given = find_terms(log.samples, others)
    columns = np.hstack([given, there, (after - before) / (2 * by)])
    names = tuple(f"shape{k}_part" for k in range(columns.shape[1]))
    samples = log.samples.with_columns(
        disturbers={**known, **dict(zip(names, columns.T, strict=True))}
    )
    rows = np.flatnonzero(log.usable)
    rows = rows[:: -(-len(rows) // MOST_ROWS)]
    found = fit_channels_alone(
        samples.select(rows),
        log.reference.select(rows),
        log.channels,
        replace(log.settings, sources=names),
        near,
        {names[: given.shape[1]]: log.estimates[others]},
    )
    assert isinstance(found, Interference)
    return *_compare_slopes(found, given.shape[1], there.shape[1]), found


def _compare_slopes(found: Interference, first: int, count: int) -> tuple[float, float]:
    """δ and its standard error, by `count` terms from the `first` and the slopes behind them."""
    width = found.coefficients.shape[1]
    at = np.arange(3 * width).reshape(3, width)[:, first + count :].ravel()
    assert found.covariance is not None
    covariance = found.covariance[-3 * width :, -3 * width :][np.ix_(at, at)]
    terms: Array = found.coefficients[:, first : first + count].ravel()
    slopes: Array = found.coefficients[:, first + count :].ravel()
    return find_move(terms, slopes, covariance)


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
