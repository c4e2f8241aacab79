"""The errors of unseen readings over time, beside what was stated of them."""

from __future__ import annotations

import numpy as np

from agonic.recording.evaluation.cross_validation import Evaluation, Measure
from agonic.report.axes import Axis, Columns
from agonic.report.markup import Markup
from agonic.report.strips import arrows, beyond_words, caption, line, plot, robust_limit, spread
from agonic.report.time_axis import along_rows


def draw_errors(result: Evaluation, one: Measure) -> Markup:
    """One kind of error over time: as recorded, by fits that had not seen it, and as stated."""
    found, stated = result.unseen.errors[one.kind]
    recorded = result.recorded.errors[one.kind].found
    least = min(3.0 * one.stated, 2.0 * float(np.abs(found).max())) or 1e-9
    limit = robust_limit(found, least)
    x, along = along_rows(result.samples.time, np.arange(len(found)))
    y = Axis(f"error of the {one.kind}, {one.unit}", -limit, limit)
    columns = Columns(x, along)
    layers = [
        spread(columns, y, recorded, "before"),
        spread(columns, y, found, "after"),
        *(line(columns, y, columns.mean(sign * stated), "noise") for sign in (-1.0, 1.0)),
    ]
    words = f"Error of the {one.kind} on unseen readings over time"
    keys = {
        "before": "as recorded",
        "after": "by fits that had not seen the reading",
        "noise": "± the standard error that they state",
    }
    drawn = plot(x, y, layers, words, arrows(columns, y, found))
    return caption(words, drawn, keys, beyond_words(found, limit, one.unit))
