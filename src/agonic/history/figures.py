"""Figures of a drift: each parameter over time with its bands, and the steps in it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from agonic.arrays import Array
from agonic.history.fit import sample_times
from agonic.history.result import Drift, Event
from agonic.history.trend import YEAR_S, Trend
from agonic.report.axes import Axis, down, right
from agonic.report.markup import Markup, element
from agonic.report.strips import caption, path, plot, points

DAYS_A_YEAR = 365.25
DAYS_A_MONTH = DAYS_A_YEAR / 12
_WIDE = 2.0  # standard deviations that bands reach to either side
_UNITS_S = {"days": 86_400.0, "months": DAYS_A_MONTH * 86_400.0, "years": YEAR_S}


def choose_unit(days: float) -> str:
    """Days, months or years, by how long a history is.

    >>> choose_unit(89), choose_unit(90), choose_unit(900)
    ('days', 'months', 'years')
    """
    return "days" if days < 90.0 else "years" if days >= 900.0 else "months"


def draw_trends(trends: Sequence[Trend], drift: Drift) -> Markup:
    """The parameters of one kind beside each other, with a legend."""
    keys = {
        "seen": "calibration and its standard error",
        "level": "parameter",
        "band": "where it is, ± 2 sd",
        "calibrations": "where a calibration of usual quality falls, ± 2 sd",
    }
    if any(_find_steps(one, drift) for one in trends):
        keys["step"] = "step"
    if any(shift.outlier for one in trends for shift in one.shifts):
        keys["astray"] = "outlier"
    first = trends[0]
    note = "" if first.kind == "bias" else "To first order the same however the matrix was turned."
    drawn = element("div", *(draw_trend(one, drift) for one in trends), class_="multiples")
    return caption(f"In {first.unit}" if first.unit else "As a ratio", drawn, keys, note)


def draw_trend(one: Trend, drift: Drift) -> Markup:
    """One parameter over time: calibrations, the line that they follow, its bands, and steps."""
    time = np.unique(np.concatenate([sample_times(drift), one.time]))
    band = one.at(time)
    start, unit = drift.trends[0].time[0], choose_unit(np.ptp(sample_times(drift, 2)) / 86_400.0)
    along, seen = ((t - start) / _UNITS_S[unit] for t in (time, one.time))
    margin = 0.02 * float(along[-1])
    label = f"{unit} since {datetime.fromtimestamp(float(start), UTC):%Y-%m-%d}"
    x = Axis(label, -margin, float(along[-1]) + margin)
    reach = _WIDE * band.calibration_sd
    shown = [band.mean - reach, band.mean + reach, one.value - one.sd, one.value + one.sd]
    y = _make_axis(one.name, np.concatenate(shown))

    def draw_step(event: Event) -> Markup:
        """The time between the two calibrations that it lies between."""
        ends = np.array([event.after.timestamp(), event.before.timestamp()])
        left, stop = right(x, (ends - start) / _UNITS_S[unit])
        return path(f"M{left:.1f} 0H{stop:.1f}V1000H{left:.1f}Z", "step")

    def draw_band(half: Array, name: str) -> Markup:
        there = points(right(x, along), down(y, band.mean + half))
        back = points(right(x, along[::-1]), down(y, (band.mean - half)[::-1]))
        return path(f"M{there}L{back}Z", name)

    layers = [
        *map(draw_step, _find_steps(one, drift)),
        draw_band(reach, "calibrations"),
        draw_band(_WIDE * band.sd, "band"),
        path(f"M{points(right(x, along), down(y, band.mean))}", "level"),
        *_draw_calibrations(one, right(x, seen), y),
    ]
    return plot(x, y, layers, f"{one.name} over time with its bands", kind="small")


def _draw_calibrations(one: Trend, at: Array, y: Axis) -> list[Markup]:
    """Their standard errors, and their values as dots."""
    outlier = np.isin(np.arange(len(one.time)), [s.place for s in one.shifts if s.outlier])
    ends = zip(at, down(y, one.value + one.sd), down(y, one.value - one.sd), strict=True)
    layers = [path("".join(f"M{a:.1f} {b:.1f}V{c:.1f}" for a, b, c in ends if b == b), "sd")]
    told = np.isfinite(one.value)
    for name, rows in (("seen", ~outlier & told), ("astray", outlier & told)):
        if rows.any():
            places = zip(at[rows], down(y, one.value)[rows], strict=True)
            layers.append(path("".join(f"M{a:.1f} {b:.1f}h0" for a, b in places), name))
    return layers


def _find_steps(one: Trend, drift: Drift) -> list[Event]:
    """The steps that show in a parameter."""
    steps = (event for event in drift.events if event.kind == "step")
    return [step for step in steps if one.name in [moved.name for moved in step.parameters]]


def _make_axis(label: str, values: Array) -> Axis:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = max(0.06 * (high - low), 1e-9 * max(abs(low), abs(high)), 1e-12)
    return Axis(label, low - margin, high + margin)
