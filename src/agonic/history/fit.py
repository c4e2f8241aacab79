"""`drift`: how the calibration of one sensor moved over time, and whether the last one belongs."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.calibration.decomposition import PAIRS
from agonic.errors import AgonicError
from agonic.health import Finding
from agonic.health.finding import figure
from agonic.history.maths.change_points import (
    ChangePoint,
    estimate_size,
    find_change_points,
    join_design,
)
from agonic.history.maths.drift_model import Series, compute_posterior
from agonic.history.result import Drift, Event, ParameterChange, Trend, make_series, summarise
from agonic.population import Population
from agonic.population.population import AXES
from agonic.population.store_schema import UNDATED
from agonic.units import RAW

KINDS = ("bias", "gain", "cross")
"""Bias in the unit of the readings; gain, the diagonal of the matrix; cross, the symmetric part of
what is off it, which to first order is the same in every gauge."""
NAMES = (
    *(f"{kind} {axis}" for kind in KINDS[:2] for axis in AXES),
    *(f"cross {AXES[i]}{AXES[j]}" for i, j in PAIRS),
)


class Parameters(NamedTuple):
    """Values and standard errors (n, 9) in the order of `NAMES`, and their units; NaN for what the
    model of a row does not hold.
    """

    values: Array
    sd: Array
    units: tuple[str, ...]


def find_comparable(population: Population) -> Index:
    """The rows that can be compared with the last calibration: its channel, its units. Their biases
    are known, within bounds."""
    known = np.isfinite(population.bias) & ~np.isinf(population.bias_sd)
    rows = np.flatnonzero(population.fitted & known.all(axis=1))
    if not len(rows):
        return rows
    same = np.ones(len(rows), dtype=bool)
    for name in ("channel", "unit_in", "unit_out"):
        same &= population[name][rows] == population[name][rows[-1]]
    return rows[same]


def extract_parameters(population: Population) -> Parameters:
    """The parameters of every row; those without bounds are not known."""
    matrix, matrix_sd = population.matrix, np.nan_to_num(population.matrix_sd, posinf=np.inf)
    axes = np.arange(3)
    values = np.hstack([population.bias, matrix[:, axes, axes], population.cross])
    bias_sd = np.nan_to_num(population.bias_sd, posinf=np.inf)
    sd = np.hstack([bias_sd, matrix_sd[:, axes, axes], population.cross_sd])
    return Parameters(np.where(np.isfinite(sd), values, np.nan), sd, _name_units(population))


def _name_units(population: Population) -> tuple[str, ...]:
    if not len(population):
        return ("",) * 9
    into, out = (str(population[name][-1] or "") for name in ("unit_in", "unit_out"))
    bias = "raw units" if into == RAW else into
    gain = "" if into == out else f"{out} per {'count' if into == RAW else into}"
    return (bias,) * 3 + (gain,) * 6


MIN_CALIBRATIONS = 5
"""Calibrations from which on a drift can be told from scatter."""
MAX_CHANCE = 0.004
"""How often chance makes a step, or a calibration off its band, in a history of all parameters."""
MAX_DRIFT_CHANCE = 0.01
"""How often chance makes any parameter of a sensor seem to drift."""


def drift(population: Population, at: datetime | None = None) -> Drift:
    """How the calibration of a sensor drifts, walks at random and steps, with bands.

        parameter = level + slope·t + steps + random walk + scatter + formal error

    Sizes of walk and scatter are not known, for standard errors of calibrations say nothing of
    what happens between days. They are averaged over with the restricted likelihood, so that few
    calibrations give wide bands. A step, an outlier, or a last one that lies off what the
    earlier ones predict, is one where chance makes any in the whole history in less than 1 %.

    Parameters
    ----------
    population : the calibrations of one sensor, in any order, as `History.of` gives them.
    at : the date for which the parameters are predicted, now without.

    Raises `AgonicError` where there is no calibration, one has no date, or `at` is before
    the first.

    Source: Harvey, Koopman, J. Bus. Econ. Stat. 10 (1992) 377; Patterson, Thompson, Biometrika 58
    (1971) 545.

    Examples
    --------
    >>> from agonic.population import Row
    >>> noise = [0.4, -1.1, 0.9, 0.2, -0.6, 1.3, -0.3, -0.8, 0.5, 0.1]
    >>> rows = [Row(sensor="7", source=f"{k}.csv", verdict="good", status="", unit_in="nT",
    ...             start=datetime(2026, 1 + k, 1, tzinfo=UTC), bias_x=30.0 * k + e, bias_y=e,
    ...             bias_z=-e, bias_x_sd=1.0, bias_y_sd=1.0, bias_z_sd=1.0)
    ...         for k, e in enumerate(noise)]
    >>> found = drift(Population.of(rows), at=datetime(2026, 12, 1, tzinfo=UTC))
    >>> one = found.trend("bias x")
    >>> found.verdict, round(one.slope, -1), one.slope_sd < 20
    ('good', 360.0, True)
    """
    moment = (at or datetime.now(UTC)).astimezone(UTC)
    if not len(population):
        raise AgonicError("there is no calibration to follow")
    population = _sort_by_time(population)
    compared = find_comparable(population)
    chosen = population.select(compared)
    if None in chosen["start"].tolist():
        raise AgonicError("a calibration has no date; a History dates those that are added to it")
    time = np.array([start.timestamp() for start in chosen["start"]])
    if len(time) and moment.timestamp() < time[0]:
        raise AgonicError(f"{moment:%Y-%m-%d} is before the first calibration")
    enough = len(time) >= MIN_CALIBRATIONS and time[-1] > time[0]
    trends, events = _fit_trends(time, extract_parameters(chosen)) if enough else ((), ())
    return Drift(
        sensor=str(population["sensor"][-1]),
        at=moment,
        population=population,
        compared=compared,
        trends=trends,
        events=events,
        findings=tuple(_find(population, compared, trends, events)),
        remarks=_make_remarks(trends, moment),
    )


def _sort_by_time(population: Population) -> Population:
    """The calibrations in order of time, those without a date first."""
    starts = population["start"].tolist()
    moments = [-np.inf if start is None else start.timestamp() for start in starts]
    return population.select(np.argsort(moments, kind="stable"))


def _fit_trends(time: Array, of: Parameters) -> tuple[tuple[Trend, ...], tuple[Event, ...]]:
    """The trends of all parameters that most calibrations tell and that move at all, and what
    happened.
    """
    known = [k for k in range(len(NAMES)) if _can_follow(of.values[:, k])]
    many = [make_series(time, of.values[:, k], of.sd[:, k]) for k in known]
    found = find_change_points(many, MAX_CHANCE)
    trends = []
    for number, k in enumerate(known):
        series = join_design(many[number], found, number)
        own = tuple(s for s in found if s.outlier or number in s.where)
        posterior = compute_posterior(series)
        trends.append(
            Trend(
                name=NAMES[k],
                unit=of.units[k],
                time=time,
                value=of.values[:, k],
                sd=of.sd[:, k],
                series=series,
                posterior=posterior,
                shifts=own,
                **summarise(posterior, float(time[-1] - time[0])),
            )
        )
    events = [_make_event(trends, many, found, shift) for shift in found]
    return tuple(trends), tuple(sorted(events, key=lambda event: event.place))


def _can_follow(values: Array) -> bool:
    """Whether enough calibrations tell a parameter, and it moves at all."""
    told = values[np.isfinite(values)]
    return len(told) >= MIN_CALIBRATIONS and 2 * len(told) > len(values) and bool(np.ptp(told) > 0)


def _make_event(
    trends: list[Trend], many: list[Series], found: list[ChangePoint], shift: ChangePoint
) -> Event:
    others = [s for s in found if s is not shift]
    moved = []
    for k in shift.where:
        posterior = estimate_size(join_design(many[k], others, k), shift)
        last = posterior.beta.shape[-1] - 1
        size, sd = float(posterior.mean(last)), float(posterior.sd(last))
        moved.append(ParameterChange(trends[k].name, trends[k].unit, size, sd))
    time, place = trends[0].time, shift.place
    kind = "step" if not shift.outlier else "last" if place == len(time) - 1 else "outlier"
    after, before = (
        datetime.fromtimestamp(float(time[at]), UTC) for at in (place - (kind != "outlier"), place)
    )
    return Event(kind, place, after, before, shift.p_value, tuple(moved))


def _find(
    population: Population, compared: Index, trends: tuple[Trend, ...], events: tuple[Event, ...]
) -> Iterator[Finding]:
    if population["verdict"][-1] == "refused":
        yield Finding(
            "last one refused",
            "check",
            f"the last calibration, of {population['source'][-1]}, was refused",
            "see its status, and calibrate again",
        )
    yield from (_describe_event(event, len(compared)) for event in events)
    if len(compared) < MIN_CALIBRATIONS:
        few = (
            f"{len(compared)} can be compared; from {MIN_CALIBRATIONS} on a drift can be determined"
        )
        yield Finding("few calibrations", "note", few)
    if left_out := int(population.fitted.sum()) - len(compared):
        others = f"{left_out} earlier ones are of another channel or unit"
        yield Finding("not compared", "note", others)
    if any(UNDATED.name in names for names in population["findings"]):
        yield UNDATED
    if moving := [one for one in trends if one.p_value * len(trends) < MAX_DRIFT_CHANCE]:
        slopes = (
            f"{one.name} by {_format_signed(one.slope, one.slope_sd)} ± "
            f"{_format(one.slope_sd, one.unit)} a year"
            for one in moving
        )
        yield Finding("drifting", "note", "it drifts: " + ", ".join(slopes))


def _describe_event(event: Event, n: int) -> Finding:
    moved = ", ".join(
        f"{one.name} by {_format_signed(one.size, one.sd)} ± {_format(one.sd, one.unit)}"
        for one in event.parameters
    )
    if event.kind == "last":
        return Finding(
            "left its band",
            "check",
            f"the last calibration, of {event.before:%Y-%m-%d}, differs from what the earlier "
            f"ones predict: {moved}",
            "calibrate once more: a step stays, an outlier does not",
        )
    if event.kind == "outlier":
        return Finding(
            "outlying calibration",
            "note",
            f"that of {event.before:%Y-%m-%d} differs from those before and after it: {moved}; it "
            "is left out of the drift",
        )
    fresh = n - event.place < 4  # calibrations since
    return Finding(
        "step",
        "check" if fresh else "note",
        f"between {event.after:%Y-%m-%d} and {event.before:%Y-%m-%d} it stepped: {moved}",
        "see what was changed on the board or near it in that time" if fresh else "",
    )


def _make_remarks(trends: tuple[Trend, ...], at: datetime) -> tuple[str, ...]:
    known = [f"{t.name} {_format(t.predict(at)[1], t.unit)}" for t in trends[:3]]
    return (f"standard error on {at:%Y-%m-%d}: {', '.join(known)}",) if known else ()


def _format_signed(value: float, sd: float) -> str:
    """A number with its sign, to the second digit of its standard deviation."""
    decimals = int(np.clip(1 - np.floor(np.log10(max(sd, 1e-300))), 0, 12))
    return f"{value:+.{decimals}f}"


def _format(value: float, unit: str) -> str:
    return f"{figure(value)} {unit}".rstrip()


def sample_times(drift: Drift, count: int = 200) -> Array:
    """Moments (count,) from the first calibration to the date of the drift, seconds since 1970."""
    first = drift.trends[0].time[0]
    return np.linspace(first, max(drift.at.timestamp(), first + 1.0), count)
