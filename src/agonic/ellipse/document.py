"""What is said and shown of a two-axis compass."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.ellipse.result import EllipseFit
from agonic.readable import make_record
from agonic.report import tables
from agonic.report.axes import about_zero, over_rows
from agonic.report.digits import count, degrees, each_with_sd, group_digits, percent, quantity
from agonic.report.document import Document
from agonic.report.figure import Figure, figure
from agonic.report.labels import unit_label
from agonic.report.marks import level, spread
from agonic.report.markup import Markup, element
from agonic.report.section import Section, Table, aside
from agonic.report.verdict import WHEN_GOOD

_MOST = 1500
"""Readings that are drawn, evenly chosen."""


def draw_circles(fit: EllipseFit) -> list[Markup]:
    """Readings in the plane before and after, each with a circle about its middle."""
    unit = unit_label(fit.calibration.unit_in)
    gain = float(np.trace(fit.matrix[:2, :2])) / 2
    radius = (fit.calibration.magnitude or 1.0) / gain
    field = fit.calibration.correct(fit.samples.field)[:, :2] / gain
    raw = fit.samples.field[:, :2]
    return [
        element(
            "div",
            _draw(raw, fit.bias[:2], radius, f"Before: as logged, about the origin, {unit}"),
            _draw(field, None, radius, f"After: on a circle about zero, {quantity(radius, unit)}"),
            class_="pair",
        ),
        aside(f"{count(min(len(raw), _MOST), 'reading')} drawn."),
    ]


def _draw(points: Array, middle: Array | None, radius: float, words: str) -> Markup:
    """Points (n, 2) about the origin, the circle, and a cross at their middle."""
    chosen = points[:: -(-len(points) // _MOST)]
    reach = 1.1 * max(float(np.abs(chosen).max()), radius)
    shown = 150 * chosen / reach
    dots = "".join(f"M{y:.1f} {-x:.1f}h0" for x, y in shown)  # x, forward, is up; y to the right
    ink = {"fill": "none", "stroke": "currentColor"}
    parts = [
        element("path", d="M-150 0H150M0 -150V150", stroke_width=0.5, opacity=0.4, **ink),
        element("circle", r=f"{150 * radius / reach:.1f}", stroke_dasharray="4 3", **ink),
        element("path", d=dots, stroke_width=2, stroke_linecap="round", opacity=0.6, **ink),
    ]
    if middle is not None:
        x, y = 150 * middle / reach
        parts.append(element("path", d=f"M{y - 5:.1f} {-x:.1f}h10m-5 -5v10", stroke_width=2, **ink))
    picture = element(
        "svg", *parts, viewBox="-155 -155 310 310", role="img", aria_label=words, width="100%"
    )
    return element("figure", picture, element("figcaption", words))


def draw_residuals(fit: EllipseFit) -> Figure:
    """Distances from the ellipse over the log, with lines at the noise."""
    unit = unit_label(fit.calibration.unit_in)
    shown = np.abs(fit.residuals[fit.weights > 0])
    limit = max(float(shown.max(initial=0.0)), 3 * fit.noise, 1e-9)
    columns = over_rows(fit.samples.time, len(fit.samples))
    words = f"± noise, {quantity(fit.noise, unit, 2)}"
    noise = level("noise", [-fit.noise, fit.noise], words=words)
    y = about_zero(f"residual, {unit}", limit)
    return figure("Residuals over the log", columns.x, y, spread(columns, fit.residuals), noise)


_NAMES = ("bias x", "bias y", "matrix xx", "matrix yy", "matrix xy")


def describe_ellipse(
    fit: EllipseFit, files: Sequence[str] = (), warnings: Sequence[str] = ()
) -> Document:
    """What is said and shown of one two-axis compass; `files` are those written of it."""
    unit = unit_label(fit.calibration.unit_in)
    rows = list_numbers(fit)
    move = WHEN_GOOD if fit.verdict == "good" else None
    spread = f"{percent(fit.spread_before)} → {percent(fit.spread_after)}"
    return Document.judge(
        fit,
        name=fit.samples.name,
        method=f"ellipse of two axes, {group_digits(fit.n)} readings",
        move=move,
        remarks=warnings,
        key_figures=()
        if fit.verdict == "refused"
        else [
            ("Spread of magnitude", spread, "before → after"),
            ("Heading standard error", degrees(fit.heading_sd_deg), "level, of the calibration"),
            ("Noise", quantity(fit.noise, unit, 2), "one reading on one axis"),
            ("Circle", f"{fit.seen_deg:.0f}°", f"seen, from {group_digits(fit.n)} readings"),
        ],
        entries={
            "Bias": f"x {rows[0][1]}   y {rows[1][1]} {unit}",
            "Matrix": f"xx {rows[2][1]}   yy {rows[3][1]}   xy {rows[4][1]}",
            "Spread": f"{spread} (before → after)   noise {quantity(fit.noise, unit, 2)}",
            "Heading": f"{degrees(fit.heading_sd_deg)} (level, of the calibration)",
            "Made of": ", ".join(tables.list_shares(fit.shares, most=4)),
            "Circle": f"{fit.seen_deg:.0f}° seen",
        },
        entries_title="",
        refused_numbers=True,
        sections=[
            Section("Numbers", [Table(("Number", "This calibration"), _name_units(rows, unit))]),
            Section("Before and after", [lambda: draw_circles(fit)]),
            Section("Residuals", [lambda: draw_residuals(fit)]),
            Section("What it does not determine", [WITHOUT_Z]),
        ],
        values=_list_values(fit, files),
        calibration=fit.calibration,
        samples=fit.samples,
    )


WITHOUT_Z = (
    "The heading of a two-axis compass is right only while it is level: a tilt adds part of the "
    "vertical field and turns the heading by up to the tilt times the tangent of the dip. How the "
    "sensor is turned about the vertical in the vehicle is not known either: swing the compass "
    "for that (agonic fit deviation)."
)


def list_numbers(fit: EllipseFit) -> list[tuple[str, str]]:
    """The five numbers, each with its standard error."""
    values = [*fit.bias[:2], fit.matrix[0, 0], fit.matrix[1, 1], fit.matrix[0, 1]]
    errors = fit.sd[[0, 1, 3, 4, 6]]
    return [*zip(_NAMES, each_with_sd(values, errors), strict=True)]


def _name_units(rows: list[tuple[str, str]], unit: str) -> list[tuple[str, str]]:
    """The numbers with the unit of the bias in its name."""
    return [(f"{n}, {unit}" if n.startswith("bias") else n, number) for n, number in rows]


def _list_values(fit: EllipseFit, files: Sequence[str]) -> dict[str, Any]:
    in_nt = fit.calibration.unit_in == "nT"
    return {
        "sensor": fit.samples.name,
        "method": "ellipse",
        "model": "ellipse",
        "axes": "xy",
        "verdict": fit.verdict,
        "status": fit.status,
        **make_record(fit),
        "shares": fit.shares,
        "unit": fit.calibration.unit_in,
        "bias_nT": fit.bias[:2] if in_nt else None,
        "bias_sd_nT": fit.sd[:2] if in_nt else None,
        "bias": fit.bias[:2],
        "bias_sd": fit.sd[:2],
        "matrix": fit.matrix[:2, :2],
        "matrix_sd": fit.sd[[3, 4, 6]],
        "magnitude": fit.calibration.magnitude,
        "noise_nT": fit.noise if in_nt else None,
        "coverage": float(np.count_nonzero(fit.sectors)) / len(fit.sectors),
        "files": list(files),
    }
