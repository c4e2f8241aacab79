"""`history_page`: how the calibration of one sensor moved over time, as one page."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np

from agonic.arrays import Array
from agonic.history import Drift, Event, Trend
from agonic.history.fit import sample_times
from agonic.history.parameters import KINDS
from agonic.history.report.record import figures
from agonic.population import Row
from agonic.population.store_schema import UNDATED
from agonic.report import tables as common
from agonic.report.blocks import header, key_figures, part, verdict
from agonic.report.digits import counted, minused, quantity, rounded, signed, with_sd
from agonic.report.documents import document, static
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element, markup, table
from agonic.report.strips import Axis, captioned, down, path, plot, points, right
from agonic.report.verdict import moves

KICKER = "History of a magnetometer"
MOST = 200
"""Calibrations that the table shows, the last ones."""
_WIDE = 2.0  # standard deviations that bands reach to either side
_DAY_S, _MONTHS, _YEARS = 86_400.0, 90.0, 900.0  # days from which on the axis has months, years
_TITLES = {
    "bias": "Bias",
    "gain": "Gain along the axes",
    "cross": "Between the axes",
}


def history_page(drift: Drift, *, title: str = "") -> str:
    """How the calibration of a sensor moved over time, as one self-contained HTML page.

    Parameters
    ----------
    drift : as `agonic.drift` gives it. title : default: the sensor.

    >>> from agonic.history import drift
    >>> from agonic.population import Population
    >>> rows = [Row(sensor="<7>", source=f"{k}.csv", verdict="good", status="", bias_x=float(k % 3),
    ...             bias_y=0.0, bias_z=0.0, start=datetime(2026, 1, 1 + k, tzinfo=UTC))
    ...         for k in range(6)]
    >>> page = history_page(drift(Population.of(rows), datetime(2026, 2, 1, tzinfo=UTC)))
    >>> page.count("&lt;7&gt;"), "Bias" in page
    (2, True)
    """
    name = title or drift.sensor
    first = next(iter(moves(drift.findings)), "")
    parts = [
        verdict(drift.verdict, minused(drift.status), move=first),
        _key_figures(drift),
        *(_of_kind(drift, kind) for kind in KINDS if _trends(drift, kind)),
        part("Drift", _drifts(drift)) if drift.trends else "",
        part("Steps and strays", _events(drift)) if drift.events else "",
        part("Findings", common.findings(drift.findings)),
        part("Calibrations", *_calibrations(drift)),
    ]
    body = markup(header(KICKER, name), element("main", *parts))
    style = static("report.css") + static("thermal.css") + static("history.css")
    return document(f"{KICKER}: {name}", body, style=style)


def _key_figures(drift: Drift) -> Markup:
    starts = [start for start in drift.population["start"] if start is not None]
    refused = int((~drift.population.fitted).sum())
    entries = [("Calibrations", str(len(drift.population)), f"{refused} refused")]
    if starts:
        span = (max(starts) - min(starts)).total_seconds() / _DAY_S
        entries.append(("Over", _span(span), f"{min(starts):%Y-%m-%d} to {max(starts):%Y-%m-%d}"))
    if drift.trends:
        worst = max(_trends(drift, "bias") or drift.trends, key=lambda one: _sd_at(one, drift.at))
        sd = _sd_at(worst, drift.at)
        known = f"± {rounded(sd, sd)} {worst.unit}".rstrip()
        entries.append(("Known to", known, f"{worst.name} on {drift.at:%Y-%m-%d}"))
    steps = sum(event.kind == "step" for event in drift.events)
    entries.append(("Steps", str(steps), "told from drift and scatter"))
    return key_figures(entries)


def _span(days: float) -> str:
    if days < _MONTHS:
        return quantity(days, "days", 2)
    return (
        quantity(days / 365.25, "years", 2)
        if days >= _YEARS
        else quantity(days / 30.44, "months", 2)
    )


def _sd_at(one: Trend, at: datetime) -> float:
    return float(one.at(np.array([at.timestamp()])).sd[0])


def _trends(drift: Drift, kind: str) -> list[Trend]:
    return [one for one in drift.trends if one.name.startswith(kind)]


# ---- strips --------------------------------------------------------------------------------------


def _of_kind(drift: Drift, kind: str) -> Markup:
    strips = [strip(one, drift) for one in _trends(drift, kind)]
    keys = {
        "seen": "calibration and its standard error",
        "level": "parameter",
        "band": "where it is, ± 2 sd",
        "calibrations": "where a calibration of usual quality falls, ± 2 sd",
    }
    for event, word in (("step", "step"), ("astray", "astray")):
        if any(f'class="{event}"' in drawn for drawn in strips):
            keys[event] = word
    note = "" if kind == "bias" else "To first order the same however the matrix was turned."
    drawn = element("div", *strips, class_="multiples")
    return part(_TITLES[kind], captioned(_unit(drift, kind), drawn, keys, note))


def _unit(drift: Drift, kind: str) -> str:
    unit = _trends(drift, kind)[0].unit
    return f"In {unit}" if unit else "As a ratio"


def strip(one: Trend, drift: Drift) -> Markup:
    """One parameter over time: calibrations, the line that they follow, its bands, and steps."""
    time = np.unique(np.concatenate([sample_times(drift), one.time]))
    band = one.at(time)
    x, along = _time_axis(time, drift)
    reach = _WIDE * band.calibration_sd
    shown = [band.mean - reach, band.mean + reach, one.value - one.sd, one.value + one.sd]
    y = _around(one.name, np.concatenate(shown))
    layers = [_step(x, y, event, drift) for event in drift.events if _steps(event, one)]
    layers += [
        _area(x, y, along, band.mean, reach, "calibrations"),
        _area(x, y, along, band.mean, _WIDE * band.sd, "band"),
        path(f"M{points(right(x, along), down(y, band.mean))}", "level"),
    ]
    astray = np.isin(np.arange(len(one.time)), [s.place for s in one.shifts if s.stray])
    at = right(x, _since(one.time, drift))
    ends = zip(at, down(y, one.value + one.sd), down(y, one.value - one.sd), strict=True)
    layers.append(path("".join(f"M{a:.1f} {b:.1f}V{c:.1f}" for a, b, c in ends), "sd"))
    for name, rows in (("seen", ~astray), ("astray", astray)):
        if rows.any():
            places = zip(at[rows], down(y, one.value)[rows], strict=True)
            layers.append(path("".join(f"M{a:.1f} {b:.1f}h0" for a, b in places), name))
    words = f"{one.name} over time with its bands"
    return plot(x, y, layers, words, kind="small")


def _since(time: Array, drift: Drift) -> Array:
    """Times in the unit of the axis, from the first calibration on."""
    return np.asarray((time - drift.trends[0].time[0]) / _unit_of_time(drift)[0])


def _unit_of_time(drift: Drift) -> tuple[float, str]:
    ends = sample_times(drift, 2)
    days = float(ends[1] - ends[0]) / _DAY_S
    if days < _MONTHS:
        return _DAY_S, "days"
    return (365.25 * _DAY_S, "years") if days >= _YEARS else (30.4375 * _DAY_S, "months")


def _time_axis(time: Array, drift: Drift) -> tuple[Axis, Array]:
    along = _since(time, drift)
    first = datetime.fromtimestamp(float(drift.trends[0].time[0]), UTC)
    margin = 0.02 * float(along[-1])
    label = f"{_unit_of_time(drift)[1]} since {first:%Y-%m-%d}"
    return Axis(label, -margin, float(along[-1]) + margin), along


def _around(label: str, values: Array) -> Axis:
    low, high = float(values.min()), float(values.max())
    margin = max(0.06 * (high - low), 1e-9 * max(abs(low), abs(high)), 1e-12)
    return Axis(label, low - margin, high + margin)


def _area(x: Axis, y: Axis, at: Array, mean: Array, reach: Array, name: str) -> Markup:
    there = points(right(x, at), down(y, mean + reach))
    back = points(right(x, at[::-1]), down(y, (mean - reach)[::-1]))
    return path(f"M{there}L{back}Z", name)


def _steps(event: Event, one: Trend) -> bool:
    return event.kind == "step" and one.name in [moved.name for moved in event.parameters]


def _step(x: Axis, y: Axis, event: Event, drift: Drift) -> Markup:
    """The time between the two calibrations that it lies between."""
    ends = np.array([event.after.timestamp(), event.before.timestamp()])
    left, stop = right(x, _since(ends, drift))
    return path(f"M{left:.1f} 0H{stop:.1f}V1000H{left:.1f}Z", "step")


# ---- tables --------------------------------------------------------------------------------------


def _drifts(drift: Drift) -> Markup:
    head = ["Parameter", f"On {drift.at:%Y-%m-%d}", "Drift a year", "Chance", "Scatter", "Walk"]
    rows = []
    for one in drift.trends:
        value, slope, *sizes = figures(one, drift.at)
        rows.append([one.name, value, slope, _chance(one.p_value), *sizes])
    note = (
        "Chance: how often scatter and walk alone make such a drift. Scatter: what calibrations "
        "differ by beyond their standard errors. Walk: how far the parameter wanders in a year."
    )
    drawn = element("div", table(head, rows, class_="drifts"), class_="scrolls")
    return markup(drawn, element("p", note, class_="aside"))


def _events(drift: Drift) -> Markup:
    head = ["What", "When", "Parameter", "Size", "Chance"]
    words = {"step": "Step", "stray": "Stray", "last": "Left its band"}
    rows = []
    for event in drift.events:
        when = f"{event.before:%Y-%m-%d}"
        if event.kind == "step":
            when = f"{event.after:%Y-%m-%d} to {when}"
        for number, moved in enumerate(event.parameters):
            size = f"{signed(with_sd(moved.size, moved.sd))} {moved.unit}".rstrip()
            chance = _chance(event.p_value)
            first = [words[event.kind], when] if number == 0 else ["", ""]
            rows.append([*first, moved.name, size, chance if number == 0 else ""])
    return element("div", table(head, rows, class_="drifts"), class_="scrolls")


def _chance(p_value: float) -> str:
    if p_value < 1e-4:
        return "below 1 in 10 000"
    return quantity(100 * min(p_value, 1.0), "%", 2)


def _calibrations(drift: Drift) -> list[Markup]:
    rows = list(drift.population)
    shown = rows[-MOST:]
    unit = unit_label(rows[-1].unit_in) if rows[-1].unit_in else ""
    head = [
        "Date",
        "Verdict",
        *(f"Bias {i}{', ' + unit if unit else ''}" for i in "xyz"),
        "Temperature",
        "Log",
    ]
    made = [table(head, map(_row, shown[::-1]), class_="calibrations")]
    if any(UNDATED.name in row.findings for row in shown):
        made.append(element("p", "* the moment of adding: the log knows no date", class_="aside"))
    if len(shown) < len(rows):
        left = counted(len(rows) - len(shown), "earlier one")
        made.append(element("p", f"{left} left out.", class_="aside"))
    return [element("div", made[0], class_="scrolls"), *made[1:]]


def _row(row: Row) -> list[str]:
    date = "" if row.start is None else f"{row.start.astimezone(UTC):%Y-%m-%d}"
    cells = [
        f"{date}{'*' if UNDATED.name in row.findings else ''}",
        common.mark(row.verdict, row.verdict),
    ]
    for axis in "xyz":
        value, sd = getattr(row, f"bias_{axis}"), getattr(row, f"bias_{axis}_sd")
        cells.append(common.NOTHING if value is None else rounded(value, sd))
    warm = row.temperature_C
    cells.append(common.NOTHING if warm is None else quantity(warm, "°C"))
    return [*cells, row.source]
