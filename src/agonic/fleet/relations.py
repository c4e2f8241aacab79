"""What the bias goes with: temperature, and time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.fleet.figures import draw_scatter, make_axis
from agonic.maths.estimation.robust.robust_line import Line, fit_robust_line
from agonic.population import Population
from agonic.population.peers import LEAST, Peers
from agonic.population.population import AXES
from agonic.report.digits import count, show_sign, with_sd
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element, markup


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
