"""The swing of a gyro as figures: what the circle read over time, and what the fit leaves."""

from __future__ import annotations

import numpy as np

from agonic.alignment.maths.north import Swing, evaluate_swing_deg
from agonic.alignment.session.north import SwingRecord
from agonic.report.axes import Axis, Columns
from agonic.report.markup import Markup
from agonic.report.strips import caption, level, line, plot, spread
from agonic.report.time_axis import along_rows


def draw_swing(record: SwingRecord, swing: Swing) -> list[Markup]:
    """Readings of the circle over time with the gyro's north across, and what the fit leaves."""
    x, along = along_rows(record.time_s, np.arange(len(record.time_s)))
    columns, reading = Columns(x, along), record.reading_deg
    low, high = float(reading.min()), float(reading.max())
    room = 0.06 * max(high - low, 1e-9)
    circle = Axis("reading of the circle, °", low - room, high + room)
    course = [
        level(circle, float(swing.params[0]), "noise"),
        line(columns, circle, columns.mean(reading), "mean"),
    ]
    left = 3600 * (reading - evaluate_swing_deg(swing.params, record.time_s - record.time_s[0]))
    limit = 1.1 * max(float(np.abs(left).max()), 1e-9)
    y = Axis("residual, ″", -limit, limit)
    rest = [
        spread(columns, y, left, "range"),
        level(y, 0.0, "noise"),
        line(columns, y, columns.mean(left), "mean"),
    ]
    return [
        caption(
            "The circle following the gyro",
            plot(x, circle, course, "Readings of the circle over time"),
            {"mean": "reading", "noise": "the gyro’s north"},
        ),
        caption(
            "What the damped sinusoid leaves",
            plot(x, y, rest, "Residuals of the readings over time"),
            {"range": "least to largest", "mean": "mean"},
        ),
    ]
