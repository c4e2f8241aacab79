"""One group of sensors on the page of a fleet: distributions, biases, and what they go with."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array, Index, Mask
from agonic.fleet import figures
from agonic.fleet.figures import draw_scatter, make_axis
from agonic.fleet.summary_tables import count_days, get_numbers, has_values
from agonic.maths.estimation.robust.robust_line import Line, fit_robust_line
from agonic.population import Population
from agonic.population.peers import LEAST, Peers
from agonic.population.population import AXES
from agonic.report.digits import count, show_sign, with_sd
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element, markup
from agonic.report.section import Section


class Relation(NamedTuple):
    """Bias (n, 3) beside another quantity (n,) of some rows, and a line for each axis.

    `sensors` is the number of sensors, each with several logs, or 0 where every sensor counts once.
    """

    rows: Index
    along: Array
    bias: Array
    lines: tuple[Line, ...]
    sensors: int


def find_relation(population: Population, group: Peers, rows: Index, x: Array) -> Relation | None:
    """The relation within sensors where eight or more were seen at several x, else between them.

    Within: what each differs by from its own mean, drawn about the mean of all.
    """
    rows = rows[np.isfinite(x[rows]) & np.isfinite(population.bias[rows]).all(axis=1)]
    names, sensor = np.unique(population["sensor"][rows].astype(str), return_inverse=True)
    size = np.bincount(sensor, minlength=len(names))
    ranging = (
        np.bincount(sensor, (x[rows] - _average_by_sensor(x[rows], sensor, size)[sensor]) ** 2) > 0
    )
    several = ranging[sensor]
    if ranging.sum() >= LEAST:
        rows, sensor, taken = rows[several], sensor[several], int(ranging.sum())
        bias, along = population.bias[rows], x[rows]
        own = np.column_stack([_average_by_sensor(b, sensor, size) for b in bias.T])[sensor]
        bias = bias - own + bias.mean(axis=0)
        along = along - _average_by_sensor(along, sensor, size)[sensor] + along.mean()
    else:
        rows, taken = group.rows[np.isfinite(x[group.rows])], 0
        bias, along = population.bias[rows], x[rows]
    if len(rows) < LEAST or np.ptp(along) == 0:
        return None
    lines = tuple(fit_robust_line(along, b, taken) for b in bias.T)
    return Relation(rows, along, bias, lines, taken)


def draw_relation(
    relation: Relation, group: Peers, label: str, noted: Mask, per: tuple[str, float]
) -> Markup:
    """A figure for each axis with its line, and the slopes in a sentence."""
    unit = unit_label(group.unit_in)
    x = make_axis(relation.along, label)
    ends = float(relation.along.min()), float(relation.along.max())
    figures = [
        draw_scatter(
            x,
            make_axis(b, f"bias {axis}, {unit}"),
            relation.along,
            b,
            noted[relation.rows],
            [(line, *ends)],
        )
        for axis, b, line in zip(AXES, relation.bias.T, relation.lines, strict=True)
    ]
    return markup(_describe_slopes(relation, unit, per), element("div", *figures, class_="trio"))


def _describe_slopes(relation: Relation, unit: str, per: tuple[str, float]) -> Markup:
    name, factor = per
    parts = [
        f"{axis} {show_sign(with_sd(line.slope * factor, line.slope_sd * factor))}"
        for axis, line in zip(AXES, relation.lines, strict=True)
    ]
    who = (
        f"within {count(relation.sensors, 'sensor')} with several logs, each about its own mean"
        if relation.sensors
        else f"between {count(len(relation.rows), 'sensor')}, each counted once"
    )
    clear = [a for a, line in zip(AXES, relation.lines, strict=True) if line.sloped]
    said = f"It changes on {', '.join(clear)}" if clear else "No change is more than chance"
    return element("p", f"{said}: {', '.join(parts)} {unit} per {name} ({who}).")


def _average_by_sensor(values: Array, sensor: Index, size: Index) -> Array:
    total = np.bincount(sensor, values, minlength=len(size))
    return np.asarray(total / np.maximum(size, 1))


_LEAST_RANGE_C = 3.0
_LEAST_DAYS = 2.0
_YEAR = 365.25


def describe_group(
    population: Population,
    group: Peers,
    k: int,
    belongs: NDArray[np.int8],
    noted: Mask,
) -> Section:
    """The figures of group number `k`, whose rows are those that `belongs` to it; `noted` (n,) are
    rows whose bias stands out.
    """
    rows = np.flatnonzero(belongs == k)
    if not len(rows):
        return Section("", [])
    parts = [
        element("h3", "Distributions"),
        element("p", _USUAL if group.enough else "", class_="aside"),
        element("div", *_draw_histograms(population, group, k, rows), class_="trio"),
        *_draw_bias(population, group, k, rows, noted),
        *_draw_temperature(population, group, rows, noted),
        *_draw_time(population, group, rows, noted),
    ]
    name = f"{count(len(group), 'sensor')}: {group.name}"
    return Section(name, parts)


_USUAL = (
    "The line is the centre of the sensors and the band their spread, both estimated so that "
    "outliers do not count, each sensor once, the errors of the fits taken out. Choose bars to see "
    "their calibrations in the table."
)


def _draw_histograms(population: Population, group: Peers, k: int, rows: Index) -> list[Markup]:
    unit, out = unit_label(group.unit_in), unit_label(group.unit_out)
    gain = "" if group.unit_in == group.unit_out else f"{out} per raw unit"
    entries = [
        *((f"bias_{i}", f"bias {i}", unit, ("bias", j)) for j, i in enumerate("xyz")),
        *((f"gain_{i}", f"gain {i}", gain, ("gain", j)) for j, i in enumerate("xyz")),
        ("noise", "noise of a reading", unit, ("noise", -1)),
        ("spread_after", "spread of the magnitude", "%", ("spread", -1)),
        ("heading_sd_deg", "error of the heading", "°", None),
    ]
    drawn = (_draw_histogram(population, group, k, rows, *entry) for entry in entries)
    return [figure for figure in drawn if figure]


def _draw_histogram(
    population: Population,
    group: Peers,
    k: int,
    rows: Index,
    column: str,
    name: str,
    unit: str,
    key: tuple[str, int] | None,
) -> Markup:
    values = get_numbers(population, column)[rows]
    values = values[np.isfinite(values)]
    if not len(values):
        return Markup("")
    size = 100.0 if unit == "%" else 1.0
    usual = _get_usual(group, key, size)
    label = f"{name}, {unit}" if unit else name
    figure = figures.draw_histogram(size * values, label, column, k, usual, size)
    said = element("p", figures.describe_usual(usual, unit), class_="aside")
    return element("figure", element("figcaption", element("strong", name), said), figure)


def _get_usual(
    group: Peers, key: tuple[str, int] | None, size: float
) -> tuple[float, float] | None:
    if key is None or not group.enough:
        return None
    quantity = group.quantities[key[0]]
    centre, spread = float(quantity.centre[key[1]]), float(quantity.spread[key[1]])
    if key[1] < 0:  # logarithms
        centre, spread = float(np.exp(centre)), float(np.exp(centre) * np.sinh(spread))
    return (size * centre, size * spread) if np.isfinite(centre) else None


def _draw_bias(
    population: Population, group: Peers, k: int, rows: Index, noted: Mask
) -> list[Markup]:
    rows = rows[np.isfinite(population.bias[rows]).all(axis=1)]
    if len(rows) < 3:
        return []
    drawn = figures.draw_biases(
        group, k, population.bias[rows], noted[rows], unit_label(group.unit_in)
    )
    key = element(
        "p",
        element("i", class_="key odd-dots"),
        "stands out by its bias or axes",
        class_="legend",
    )
    return [element("h3", "Bias"), key, drawn]


def _draw_temperature(
    population: Population, group: Peers, rows: Index, noted: Mask
) -> list[Markup]:
    celsius = population["temperature_C"]
    seen = celsius[rows][np.isfinite(celsius[rows])]
    relation = find_relation(population, group, rows, celsius) if len(seen) else None
    if relation is None or np.ptp(relation.along) < _LEAST_RANGE_C:
        return []
    figure = draw_relation(relation, group, "temperature, °C", noted, ("°C", 1.0))
    return [element("h3", "Bias and temperature"), figure]


def _draw_time(population: Population, group: Peers, rows: Index, noted: Mask) -> list[Markup]:
    when = count_days(population["start"])
    if not has_values(when[rows]):
        return []
    first = float(np.nanmin(when[rows]))
    relation = find_relation(population, group, rows, when - first)
    if relation is None or np.ptp(relation.along) < _LEAST_DAYS:
        return []
    day = np.datetime64(int(first), "D")
    figure = draw_relation(relation, group, f"days since {day}", noted, ("year", _YEAR))
    return [element("h3", "Bias over time"), figure]
