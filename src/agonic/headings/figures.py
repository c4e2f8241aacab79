"""Figures of headings over time: the heading and its band, its error, dip, strength, flags."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Mask
from agonic.headings.result import FLAGS, Heading
from agonic.maths.rotations.tilt import compute_down, tilt_from_angles
from agonic.report.axes import Axis, Columns
from agonic.report.markup import Markup
from agonic.report.strips import arrows, band, caption, line, mark_rows, plot, robust_limit, spread
from agonic.report.time_axis import along_rows

_DOUBTED = {"held-out": "rows that a flag marks"}
WIDE = 2.0
"""Standard errors that the band of a heading reaches to either side."""


def draw_heading(found: Heading) -> Markup:
    """The true heading over time with its band."""
    y = Axis("true heading, °", 0.0, 360.0)
    columns, x = _columns(found)
    turned = _fill(found.true_deg, found.trusted)
    reach = WIDE * columns.mean(_fill(found.sd_deg, found.trusted))
    least, largest, middle = columns.least(turned), columns.largest(turned), columns.mean(turned)
    through_north = (largest - least > 180.0) | (np.abs(np.diff(middle, append=middle[-1])) > 180.0)
    gap = np.where(through_north, np.nan, 0.0)  # 359° is beside 1°, and far on the paper
    layers = [
        band(columns, y, least - reach + gap, largest + reach + gap, "range"),
        line(columns, y, middle + gap, "mean"),
        mark_rows(columns, ~found.trusted, "held-out"),
    ]
    keys = {"range": "± 2 standard errors", "mean": "heading", **_DOUBTED}
    return caption("Heading", plot(x, y, layers, "True heading over time"), keys)


def draw_sd(found: Heading) -> Markup:
    """The standard error of the heading over time, and the part that noise makes."""
    columns, x = _columns(found)
    sd, random = (_fill(v, found.trusted) for v in (found.sd_deg, found.random_sd_deg))
    top = robust_limit(sd, 0.1, found.trusted.astype(np.float64))
    y = Axis("standard error, °", 0.0, 1.1 * top)
    layers = [
        spread(columns, y, sd, "range"),
        line(columns, y, columns.mean(random), "noise"),
        mark_rows(columns, ~found.trusted, "held-out"),
    ]
    keys = {"range": "standard error", "noise": "of which noise, new in every reading", **_DOUBTED}
    label = "Standard error of the heading over time"
    return caption("Standard error", plot(x, y, layers, label, arrows(columns, y, sd)), keys)


def draw_field(found: Heading, field: Array) -> list[Markup]:
    """Strength and dip of the calibrated field (n, 3) over time, steady where all is well."""
    down = compute_down(tilt_from_angles(found.roll_deg, found.pitch_deg))
    size = np.linalg.norm(field, axis=1)
    dip = np.degrees(np.arcsin(np.clip(np.einsum("ni,ni->n", field, down) / size, -1, 1)))
    return [
        _draw_steady(found, size, "Strength of the field", "nT"),
        _draw_steady(found, dip, "Dip of the field", "°"),
    ]


def _draw_steady(found: Heading, values: Array, name: str, unit: str) -> Markup:
    columns, x = _columns(found)
    values = _fill(values, np.isfinite(values))
    low, high = np.percentile(values, (0.5, 99.5))
    margin = max(0.15 * float(high - low), 1e-3 * abs(float(high)), 1e-9)
    y = Axis(f"{name.split()[0].lower()}, {unit}", float(low) - margin, float(high) + margin)
    layers = [
        spread(columns, y, values, "range"),
        line(columns, y, columns.mean(values), "mean"),
        mark_rows(columns, ~found.trusted, "held-out"),
    ]
    keys = {"range": "least to largest", "mean": "mean", **_DOUBTED}
    label = f"{name} over time"
    return caption(name, plot(x, y, layers, label, arrows(columns, y, values)), keys)


def list_flags(found: Heading) -> list[list[str]]:
    """What not to trust: each flag that marks a row, how many, and what it means."""
    n = max(len(found), 1)
    return [
        [name, f"{100 * int(rows.sum()) / n:.1f} %", FLAGS[name]]
        for name, rows in found.flags.items()
        if rows.any()
    ]


def _columns(found: Heading) -> tuple[Columns, Axis]:
    x, along = along_rows(found.time, np.arange(len(found)))
    return Columns(x, along), x


def _fill(values: Array, known: Mask) -> Array:
    """Values with the median of those that are known where there is none."""
    usable = known & np.isfinite(values)
    middle = float(np.median(values[usable])) if usable.any() else 0.0
    return np.where(np.isfinite(values), values, middle)
