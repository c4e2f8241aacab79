"""What is said and shown of the history of a sensor, and of all sensors of a history."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.history.departure import Departure
from agonic.history.fit import KINDS, sample_times
from agonic.history.result import Drift, Event, Trend
from agonic.population import Row, SensorSummary
from agonic.population.store_schema import UNDATED
from agonic.readable import make_record
from agonic.report.axes import Axis, down, fit_axis, right
from agonic.report.digits import count, group_digits, quantity, round_to_sd, show_sign, with_sd
from agonic.report.document import Document
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element
from agonic.report.section import Section, Table
from agonic.report.strips import area, caption, curve, dots, path, plot
from agonic.report.tables import NOTHING, mark

_UNITS_DAYS = {"days": 1.0, "months": 365.25 / 12, "years": 365.25}


def choose_unit(days: float) -> str:
    """Days, months or years, by how long a history is."""
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
    scale = 86_400.0 * _UNITS_DAYS[unit]
    along, seen = ((t - start) / scale for t in (time, one.time))
    margin = 0.02 * float(along[-1])
    label = f"{unit} since {datetime.fromtimestamp(float(start), UTC):%Y-%m-%d}"
    x = Axis(label, -margin, float(along[-1]) + margin)
    reach = 2 * band.calibration_sd
    low, high = band.mean - reach, band.mean + reach
    y = fit_axis(one.name, np.concatenate([low, high, one.value - one.sd, one.value + one.sd]))

    def draw_step(event: Event) -> Markup:
        """The time between the two calibrations that it lies between."""
        ends = np.array([event.after.timestamp(), event.before.timestamp()])
        left, stop = right(x, (ends - start) / scale)
        return path(f"M{left:.1f} 0H{stop:.1f}V1000H{left:.1f}Z", "step")

    layers = [
        *map(draw_step, _find_steps(one, drift)),
        area(x, y, along, low, high, "calibrations"),
        area(x, y, along, band.mean - 2 * band.sd, band.mean + 2 * band.sd, "band"),
        curve(x, y, along, band.mean, "level"),
        *_draw_calibrations(one, x, seen, y),
    ]
    return plot(x, y, layers, f"{one.name} over time with its bands", kind="small")


def _draw_calibrations(one: Trend, x: Axis, seen: Array, y: Axis) -> list[Markup]:
    """Their standard errors, and their values as dots."""
    at = right(x, seen)
    outlier = np.isin(np.arange(len(one.time)), [s.place for s in one.shifts if s.outlier])
    ends = zip(at, down(y, one.value + one.sd), down(y, one.value - one.sd), strict=True)
    layers = [path("".join(f"M{a:.1f} {b:.1f}V{c:.1f}" for a, b, c in ends if b == b), "sd")]
    told = np.isfinite(one.value)
    for name, rows in (("seen", ~outlier & told), ("astray", outlier & told)):
        if rows.any():
            layers.append(dots(x, y, seen[rows], one.value[rows], name))
    return layers


def _find_steps(one: Trend, drift: Drift) -> list[Event]:
    """The steps that show in a parameter."""
    steps = (event for event in drift.events if event.kind == "step")
    return [step for step in steps if one.name in [moved.name for moved in step.parameters]]


def list_values(drift: Drift) -> dict[str, Any]:
    """All that is known of a sensor: its calibrations, trends, events and findings."""
    rows = enumerate(drift.population)
    return {
        "sensor": drift.sensor,
        "at": drift.at.isoformat(),
        "calibrations": [_record_row(row, number in drift.compared) for number, row in rows],
        "trends": [
            make_record(one)
            | dict(zip(("value", "sd", "calibration_sd"), one.predict(drift.at), strict=True))
            for one in drift.trends
        ],
        "events": [make_record(event) for event in drift.events],
        "findings": [
            {"name": f.name, "severity": f.severity, "sentence": f.sentence} for f in drift.findings
        ],
    }


def _record_row(row: Row, compared: bool) -> dict[str, Any]:
    bias, sd = ([getattr(row, f"bias_{i}{end}") for i in "xyz"] for end in ("", "_sd"))
    return {
        "start": None if row.start is None else row.start.isoformat(),
        "dated": UNDATED.name not in row.findings,
        "source": row.source,
        "verdict": row.verdict,
        "status": row.status,
        "compared": compared,
        "unit": row.unit_in,
        "bias": None if bias[0] is None else bias,
        "bias_sd": None if sd[0] is None else sd,
        "temperature_C": row.temperature_C,
    }


MAX_LISTED = 60
"""Sensors that are listed for people; programs are told all."""
MAX_TABLE_ROWS = 200
"""Calibrations in the table of the page, the last ones."""
_TITLES = {"bias": "Bias", "gain": "Gain along the axes", "cross": "Between the axes"}
_EVENTS = {"step": "Step", "outlier": "Outlier", "last": "Left its band"}
_COLUMNS = (
    "Chance: how often scatter and walk alone make such a drift. Scatter: how much calibrations "
    "differ beyond their standard errors. Walk: the random walk of the parameter in a year."
)


def describe_drift(drift: Drift, *, title: str = "") -> Document:
    """How the calibration of one sensor moved over time."""
    trends = {kind: [one for one in drift.trends if one.kind == kind] for kind in KINDS}
    sections = [
        Section(_TITLES[kind], [lambda shown=shown: draw_trends(shown, drift)])  # type: ignore[misc]
        for kind, shown in trends.items()
        if shown
    ]
    if drift.trends:
        note = element("p", _COLUMNS, class_="aside")
        sections.append(Section("Drift", [_tabulate_trends(drift), note], printed=True))
    if drift.events:
        sections.append(Section("Steps and outliers", [_tabulate_events(drift)]))
    sections.append(Section("Calibrations", _tabulate_calibrations(drift)))
    return Document(
        schema="agonic/history@1",
        kind="History of a magnetometer",
        name=drift.sensor,
        title=title,
        verdict=drift.verdict,
        status=drift.status,
        findings=drift.findings,
        key_figures=_list_key_figures(drift, trends["bias"] or drift.trends),
        entries=_list_calibrations(drift),
        entries_title="",
        sections=sections,
        values=list_values(drift),
        styles=["thermal.css", "history.css"],
    )


def describe_history(
    sensors: Sequence[SensorSummary], moving: set[str], departed: Sequence[Departure]
) -> Document:
    """All sensors of a history: how many calibrations, which drift, and which left the others."""
    rows = [make_record(one) | {"drifts": one.sensor in moving} for one in sensors]
    total = count(sum(one.calibrations for one in sensors), "calibration")
    status = f"{count(len(sensors), 'sensor')}, {total}" if sensors else "The history is empty."
    return Document(
        schema="agonic/history@1",
        name="history",
        status=status,
        sections=[*_list_sensors(rows), *_list_departures(departed)],
        values={"sensors": rows, "departures": [asdict(one) for one in departed]},
    )


# ---- all sensors ---------------------------------------------------------------------------------


def _list_sensors(rows: Sequence[Mapping[str, Any]]) -> list[Section]:
    if not rows:
        return []
    names = ("sensor", "calibrations", "first", "last", "verdict", "drifts")
    days = (
        {**row, "first": row["first"][:10], "last": row["last"][:10]} for row in rows[:MAX_LISTED]
    )
    said = ({**row, "drifts": "drifts" if row["drifts"] else ""} for row in days)
    head = ("Sensor", "Calibrations", "First", "Last", "Verdict", "Bias")
    table = Table(head, [[str(row[name]) for name in names] for row in said])
    more = len(rows) - MAX_LISTED
    note = [f"… and {group_digits(more)} more; --json lists all"] if more > 0 else []
    return [Section("", [table, *note], printed=True)]


def _list_departures(departed: Sequence[Departure]) -> list[Section]:
    if not departed:
        return []
    title = f"{count(len({one.sensor for one in departed}), 'sensor')} left the others"
    said = [f"! {one.sensor}: {one.sentence}" for one in departed[:MAX_LISTED]]
    return [Section(title, said, printed=True)]


# ---- one sensor ----------------------------------------------------------------------------------


def _list_key_figures(drift: Drift, trends: Sequence[Trend]) -> list[tuple[str, str, str]]:
    starts = [start for start in drift.population["start"] if start is not None]
    refused = int((~drift.population.fitted).sum())
    entries = [("Calibrations", str(len(drift.population)), f"{refused} refused")]
    if starts:
        first, last = min(starts), max(starts)
        days = (last - first).total_seconds() / 86_400.0
        span = quantity(days / _UNITS_DAYS[choose_unit(days)], choose_unit(days), 2)
        entries.append(("Over", span, f"{first:%Y-%m-%d} to {last:%Y-%m-%d}"))
    if trends:
        sd, worst = max(((one.predict(drift.at)[1], one) for one in trends), key=lambda k: k[0])
        known = f"± {round_to_sd(sd, sd)} {worst.unit}".rstrip()
        entries.append(("Standard error", known, f"{worst.name} on {drift.at:%Y-%m-%d}"))
    steps = sum(event.kind == "step" for event in drift.events)
    return [*entries, ("Steps", str(steps), "found beyond drift and scatter")]


def _list_calibrations(drift: Drift) -> dict[str, str]:
    """The last calibrations, each by its number and date."""
    rows = list(enumerate(drift.population, start=1))[-12:]
    return {
        f"{number}  {_format_date(row)}": f"{row.verdict}, {_format_bias(row)}{row.source}"
        for number, row in rows
    }


def _format_date(row: Row) -> str:
    """The day of a calibration, with a star where it is that of adding."""
    if row.start is None:
        return ""
    return f"{row.start.astimezone(UTC):%Y-%m-%d}{'*' if UNDATED.name in row.findings else ''}"


def _list_bias(row: Row) -> list[str | None]:
    """Bias x y z to the digits that are known, None where there is none."""
    bias = ((getattr(row, f"bias_{axis}"), getattr(row, f"bias_{axis}_sd")) for axis in "xyz")
    return [None if value is None else round_to_sd(value, sd) for value, sd in bias]


def _format_bias(row: Row) -> str:
    parts = [f"{axis} {b}" for axis, b in zip("xyz", _list_bias(row), strict=True) if b is not None]
    return f"bias {', '.join(parts)} {row.unit_in}; " if parts else ""


def _tabulate_trends(drift: Drift) -> Table:
    head = ("Parameter", f"On {drift.at:%Y-%m-%d}", "Drift a year", "Chance", "Scatter", "Walk")
    rows = []
    for one in drift.trends:
        unit = f" {one.unit}" if one.unit else ""
        mean, sd, _ = one.predict(drift.at)
        slope = show_sign(with_sd(one.slope, one.slope_sd))
        sizes = (f"{round_to_sd(size, size)}{unit}" for size in (one.scatter, one.walk))
        value = with_sd(mean, sd) + unit
        rows.append((one.name, value, slope + unit, _format_chance(one.p_value), *sizes))
    return Table(head, rows, "drifts", scrolls=True)


def _tabulate_events(drift: Drift) -> Table:
    rows = []
    for event in drift.events:
        when = f"{event.before:%Y-%m-%d}"
        if event.kind == "step":
            when = f"{event.after:%Y-%m-%d} to {when}"
        first = [_EVENTS[event.kind], when, _format_chance(event.p_value)]
        for moved in event.parameters:
            size = f"{show_sign(with_sd(moved.size, moved.sd))} {moved.unit}".rstrip()
            rows.append([*first[:2], moved.name, size, first[2]])
            first = [""] * 3
    return Table(("What", "When", "Parameter", "Size", "Chance"), rows, "drifts", scrolls=True)


def _format_chance(p_value: float) -> str:
    if p_value < 1e-4:
        return "below 1 in 10 000"
    return quantity(100 * min(p_value, 1.0), "%", 2)


def _tabulate_calibrations(drift: Drift) -> list[Table | Markup]:
    rows = list(drift.population)
    shown, unit = rows[-MAX_TABLE_ROWS:], unit_label(rows[-1].unit_in)
    bias = (f"Bias {axis}{', ' + unit if unit else ''}" for axis in "xyz")
    head = ("Date", "Verdict", *bias, "Temperature", "Log")
    cells = [
        (
            _format_date(row),
            mark(row.verdict, row.verdict),
            *(NOTHING if value is None else value for value in _list_bias(row)),
            NOTHING if row.temperature_C is None else quantity(row.temperature_C, "°C"),
            row.source,
        )
        for row in shown[::-1]
    ]
    notes = []
    if any(UNDATED.name in row.findings for row in shown):
        notes.append("* the date of adding: the log has no date")
    if len(shown) < len(rows):
        notes.append(f"{count(len(rows) - len(shown), 'earlier one')} left out.")
    table = Table(head, cells, "calibrations", scrolls=True)
    return [table, *(element("p", note, class_="aside") for note in notes)]
