"""The swing of a gyro as a figure: readings as dots, the damped sinusoid as a line."""

from __future__ import annotations

import numpy as np

from agonic.alignment.figures import svg, svg_text
from agonic.alignment.maths.north import Swing, evaluate_swing_deg
from agonic.alignment.session.north import SwingRecord
from agonic.arrays import Array
from agonic.report.digits import group_digits
from agonic.report.markup import Markup, element

WIDE, HIGH, LEFT = 760.0, 220.0, 70.0
MOST_DOTS = 300


def draw_swing(record: SwingRecord, swing: Swing) -> Markup:
    """Readings of the circle over time, the fitted swing, and a line across at its north."""
    since = record.time_s - record.time_s[0]
    low, high = float(record.reading_deg.min()), float(record.reading_deg.max())
    north = float(swing.params[0])

    def x(t: Array | float) -> Array:
        return np.asarray(LEFT + (WIDE - LEFT - 6) * np.asarray(t) / since[-1])

    def y(value: Array | float) -> Array:
        return np.asarray(8 + (HIGH - 36) * (high - np.asarray(value)) / max(high - low, 1e-12))

    fine = np.linspace(0, since[-1], 400)
    curve = zip(x(fine), y(evaluate_swing_deg(swing.params, fine)), strict=True)
    every = max(len(since) // MOST_DOTS, 1)
    dots = zip(x(since)[::every], y(record.reading_deg)[::every], strict=True)
    drawn = [
        element("path", d=f"M{LEFT} {float(y(north)):.1f}H{WIDE}", class_="zero"),
        element(
            "polyline",
            points=" ".join(f"{a:.1f},{b:.1f}" for a, b in curve),
            class_="zero",
            fill="none",
        ),
        *(element("circle", cx=f"{a:.1f}", cy=f"{b:.1f}", r="1.8", class_="dot") for a, b in dots),
        *(
            svg_text(LEFT - 6, float(y(value)) + 4, f"{group_digits(value, 3)}°", "tick")
            for value in (low, north, high)
        ),
        *(
            svg_text(
                float(x(share * since[-1])), HIGH - 6, f"{share * since[-1]:.0f} s", "tick middle"
            )
            for share in (0.12, 0.5, 0.95)
        ),
    ]
    return element(
        "figure",
        svg(drawn, "bars", WIDE, HIGH, "Readings of the circle that follow the gyro"),
        element("figcaption", "Circle against time; the line across is the gyro’s north"),
    )
