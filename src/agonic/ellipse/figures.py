"""The readings before and after, about the circle that they should lie on."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array
from agonic.ellipse.result import EllipseFit
from agonic.report.axes import Axis, Columns
from agonic.report.digits import count, quantity
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element
from agonic.report.strips import caption, level, plot, spread
from agonic.report.time_axis import along_rows

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
        element("p", f"{count(min(len(raw), _MOST), 'reading')} drawn.", class_="aside"),
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


def draw_residuals(fit: EllipseFit) -> Markup:
    """Distances from the ellipse over the log, with lines at the noise."""
    unit = unit_label(fit.calibration.unit_in)
    shown = np.abs(fit.residuals[fit.weights > 0])
    limit = max(float(shown.max(initial=0.0)), 3 * fit.noise, 1e-9)
    x, along = along_rows(fit.samples.time, np.arange(len(fit.samples)))
    y = Axis(f"residual, {unit}", -limit, limit)
    columns = Columns(x, along)
    layers = [
        spread(columns, y, fit.residuals, "range"),
        *(level(y, at * fit.noise, "noise") for at in (-1.0, 1.0)),
    ]
    drawn = plot(x, y, layers, "Distances from the ellipse over the log")
    keys = {"range": "least to largest", "noise": f"± noise, {quantity(fit.noise, unit, 2)}"}
    return caption("Residuals over the log", drawn, keys)
