"""What is said and shown of the map of a region."""

from __future__ import annotations

import numpy as np

from agonic.provenance import Input
from agonic.readable import make_record
from agonic.region.fit import CITATIONS
from agonic.region.result import FieldMap
from agonic.report.axes import Axis
from agonic.report.contours import draw_map, fit_axes, list_nodes
from agonic.report.digits import each_with_sd, group_digits, quantity, significant, with_sd
from agonic.report.document import Document
from agonic.report.fields import write_field
from agonic.report.markup import Markup
from agonic.report.section import Section, Table, list_inputs

KEYS = {
    "contour": "lines of equal value",
    "lead": "level part of what differs from the mean",
    "dots": "readings at any height",
    "wanted": "measure next",
}


def draw_region(found: FieldMap) -> list[Markup]:
    """The strength of the field, and its standard error, at half height: x up, y to the right."""
    corners = np.stack([found.low, found.high])[:, [1, 0]]
    axes = fit_axes(("y, m", "x, m"), corners, margin=0.04)
    nodes, shape = list_nodes(*axes, 20)
    inside = ((nodes >= corners[0]) & (nodes <= corners[1])).all(axis=1)
    height = float(found.low[2] + found.high[2]) / 2
    here = found.at(np.column_stack([nodes[inside][:, ::-1], np.full(inside.sum(), height)]))
    apart = (here.field - here.field.mean(axis=0))[:, [1, 0]]
    longest = float(np.linalg.norm(apart, axis=1).max()) or 1.0
    ends = nodes[inside] + (axes[0].high - axes[0].low) / 12 / longest * apart
    marks = [
        ("lead", np.stack([nodes[inside], ends], axis=1)[::3]),
        ("dots", found.readings.position[:, [1, 0]]),
        ("dots wanted", found.next_places[:, [1, 0]]),
    ]
    together: dict[tuple[float, float], list[str]] = {}  # those above each other share a name
    for k, (x, y, _) in enumerate(found.next_places.round(6).tolist(), start=1):
        together.setdefault((y, x), []).append(str(k))
    names = [(", ".join(numbers), np.array(at), "chosen") for at, numbers in together.items()]
    drawn = []
    for title, values in (
        ("Strength", here.magnitude),
        ("Standard error of the vector", np.sqrt(np.square(here.sd).sum(axis=1))),
    ):
        whole = np.full(shape, np.nan)
        whole.flat[inside] = values
        levels = Axis("", float(values.min()), float(np.percentile(values, 98))).ticks(5)
        title = f"{title} at z = {height:.2f} m, nT"
        drawn.append(
            draw_map(axes, whole, levels, title=title, keys=KEYS, marks=marks, names=names)
        )
    return drawn


def describe_map(found: FieldMap, turned: bool = False, source: Input | None = None) -> Document:
    """Field and gradient in the middle of a region, how well they are known, where to measure
    next."""
    here = found.at((found.low + found.high) / 2)
    at_readings = found.at(found.readings.position)
    sd = float(np.median(np.linalg.norm(at_readings.sd, axis=1)))
    then = np.linalg.norm(found.at(found.next_places).sd, axis=1)
    places = zip(range(1, len(then) + 1), found.next_places, then.tolist(), strict=True)
    rows = [
        [f"{k}", *(f"{v:.2f}" for v in place), quantity(one, "nT", 2)] for k, place, one in places
    ]
    head = ("Place", "x, m", "y, m", "z, m", "Standard error now")
    turns = "x to heading 0, y to the right, z down: readings were turned by their attitude"
    return Document.judge(
        found,
        schema="agonic/map@1",
        kind="Map of a region",
        name=found.name,
        method=f"{len(found.left_out)} readings",
        entries={
            "Axes": turns if turned else "those of the readings, as they are",
            "Region": " × ".join(f"{side:.2f}" for side in found.high - found.low) + " m",
            "Middle": ", ".join(each_with_sd(here.field[0], here.sd[0]))
            + f" nT, strength {with_sd(float(here.magnitude[0]), float(here.magnitude_sd[0]))} nT, "
            f"direction to {significant(float(here.direction_sd_deg[0]), 2)}°",
            "Strength": f"{group_digits(float(at_readings.magnitude.min()))} to "
            f"{group_digits(float(at_readings.magnitude.max()))} nT at the readings, the vector "
            f"there to {quantity(sd, 'nT', 2)} in the median",
            "Gradient": f"up to {quantity(float(np.abs(at_readings.gradient).max()), 'nT/m', 2)}",
            "Noise": write_field(found, "noise"),
        },
        sections=[
            Section("From above", [lambda: draw_region(found)]),
            Section("Measure next", [Table(head, rows)], printed=True),
            list_inputs(source, method=CITATIONS, equation="f(x) = u + Σⱼ T(x − sⱼ) wⱼ"),
        ],
        styles=["contours.css"],
        values={
            **make_record(found),
            "n": len(found.left_out),
            "left_out": np.flatnonzero(found.left_out),
            "middle_nT": here.field[0],
            "middle_sd_nT": here.sd[0],
            "gradient_nT_m": here.gradient[0],
            "gradient_sd_nT_m": here.gradient_sd[0],
            "next_sd_nT": then,
        },
    )
