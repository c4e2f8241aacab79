"""One group of sensors on the page of a fleet: distributions, biases, and what they go with."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.fleet import figures
from agonic.fleet.figures import draw_scatter, make_axis
from agonic.fleet.summary_tables import count_days, get_numbers, has_values
from agonic.maths.estimation.robust.robust_line import Line, fit_robust_line
from agonic.population.peers import MIN_PEERS, Peers
from agonic.population.population import AXES
from agonic.report.digits import count, show_sign, with_sd
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element
from agonic.report.section import Section, aside


class Relation(NamedTuple):
    """Bias (n, 3) beside another quantity (n,) of some rows, and a line for each axis. `sensors` is
    the number of sensors, each with several logs, or 0 where every sensor counts once."""

    rows: Index
    along: Array
    bias: Array
    lines: tuple[Line, ...]
    sensors: int


class _Drawn(NamedTuple):
    """A group by its number on the page, its calibrations, and those (n,) whose bias stands out."""

    group: Peers
    number: int
    rows: Index
    noted: Mask


def _find_relation(drawn: _Drawn, x: Array) -> Relation | None:
    """The relation within sensors where eight or more were seen at several x, else between them.
    Within: what each differs by from its own mean, drawn about the mean of all."""
    group, population = drawn.group, drawn.group.population
    rows = drawn.rows[np.isfinite(x[drawn.rows])]
    rows = rows[np.isfinite(population.bias[rows]).all(axis=1)]
    sensor = np.unique(population["sensor"][rows].astype(str), return_inverse=True)[1]

    def average(values: Array) -> Array:
        """The mean of each row's sensor."""
        return np.asarray(np.bincount(sensor, values)[sensor] / np.bincount(sensor)[sensor])

    several = (np.bincount(sensor, (x[rows] - average(x[rows])) ** 2) > 0)[sensor]
    taken = len(np.unique(sensor[several]))
    if taken >= MIN_PEERS:
        rows, sensor = rows[several], sensor[several]
        bias, along = population.bias[rows], x[rows]
        bias = bias - np.column_stack([average(b) for b in bias.T]) + bias.mean(axis=0)
        along = along - average(along) + along.mean()
    else:
        rows, taken = group.rows[np.isfinite(x[group.rows])], 0
        bias, along = population.bias[rows], x[rows]
    if len(rows) < MIN_PEERS or np.ptp(along) == 0:
        return None
    lines = tuple(fit_robust_line(along, b, taken) for b in bias.T)
    return Relation(rows, along, bias, lines, taken)


def _draw_relation(
    drawn: _Drawn, x: Array, least: float, label: str, per: tuple[str, float]
) -> Iterator[Markup]:
    """A figure for each axis with its line, and the slopes in a sentence; none where x ranges over
    less than `least`."""
    relation = _find_relation(drawn, x) if has_values(x[drawn.rows]) else None
    if relation is None or np.ptp(relation.along) < least:
        return
    unit, along = unit_label(drawn.group.unit_in), make_axis(relation.along, label)
    first, last = float(relation.along.min()), float(relation.along.max())
    shown = (
        (make_axis(b, f"bias {axis}, {unit}"), b, [(line, first, last)])
        for axis, b, line in zip(AXES, relation.bias.T, relation.lines, strict=True)
    )
    noted = drawn.noted[relation.rows]
    trio = [
        draw_scatter(along, y, relation.along, b, noted, line).to_html() for y, b, line in shown
    ]
    yield _describe_slopes(relation, unit, per)
    yield element("div", *trio, class_="trio")


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


_USUAL = (
    "The line is the centre of the sensors and the band their spread, both estimated so that "
    "outliers do not count, each sensor once, the errors of the fits taken out. Choose bars to see "
    "their calibrations in the table."
)


def describe_group(group: Peers, number: int, rows: Index, noted: Mask) -> Section:
    """The figures of a group and its calibrations `rows`; `noted` (n,) stand out by their bias."""
    if not len(rows):
        return Section("", [])
    drawn, population = _Drawn(group, number, rows, noted), group.population
    days = count_days(population["start"])
    begun = float(np.nanmin(days[rows])) if has_values(days[rows]) else 0.0
    since = f"days since {np.datetime64(int(begun), 'D')}"
    warm = _draw_relation(drawn, population["temperature_C"], 3.0, "temperature, °C", ("°C", 1.0))
    parts = {
        "Distributions": [
            aside(_USUAL if group.enough else ""),
            element("div", *_draw_histograms(drawn), class_="trio"),
        ],
        "Bias": [*_draw_bias(drawn)],
        "Bias and temperature": [*warm],
        "Bias over time": [*_draw_relation(drawn, days - begun, 2.0, since, ("year", 365.25))],
    }
    shown = [one for title, of in parts.items() if of for one in (element("h3", title), *of)]
    return Section(f"{count(len(group), 'sensor')}: {group.name}", shown)


def _draw_histograms(drawn: _Drawn) -> Iterator[Markup]:
    group = drawn.group
    unit, out = unit_label(group.unit_in), unit_label(group.unit_out)
    gain = "" if group.unit_in == group.unit_out else f"{out} per raw unit"
    entries: list[tuple[str, str, str, tuple[str, int] | None]] = [
        *((f"bias_{i}", f"bias {i}", unit, ("bias", j)) for j, i in enumerate("xyz")),
        *((f"gain_{i}", f"gain {i}", gain, ("gain", j)) for j, i in enumerate("xyz")),
        ("noise", "noise of a reading", unit, ("noise", -1)),
        ("spread_after", "spread of the magnitude", "%", ("spread", -1)),
        ("heading_sd_deg", "error of the heading", "°", None),
    ]
    for column, name, unit, key in entries:
        values = get_numbers(group.population, column)[drawn.rows]
        values = values[np.isfinite(values)]
        if len(values):
            size = 100.0 if unit == "%" else 1.0
            usual = _get_usual(group, key, size)
            label = f"{name}, {unit}" if unit else name
            figure = figures.draw_histogram(size * values, label, column, drawn.number, usual, size)
            said = aside(figures.describe_usual(usual, unit))
            head = element("figcaption", element("strong", name), said)
            yield element("figure", head, figure)


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


def _draw_bias(drawn: _Drawn) -> Iterator[Markup]:
    bias, noted = drawn.group.population.bias[drawn.rows], drawn.noted[drawn.rows]
    known = np.isfinite(bias).all(axis=1)
    if known.sum() < 3:
        return
    sign = element("i", class_="key odd-dots")
    yield element("p", sign, "stands out by its bias or axes", class_="legend")
    unit = unit_label(drawn.group.unit_in)
    yield figures.draw_biases(drawn.group, drawn.number, bias[known], noted[known], unit)
