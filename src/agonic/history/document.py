"""What is said and shown of the history of a sensor, and of all sensors of a history."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.history.departure import Departure
from agonic.history.fit import KINDS, sample_times
from agonic.history.result import Drift, Trend
from agonic.population import Row, SensorSummary
from agonic.population.store_schema import UNDATED
from agonic.readable import make_record
from agonic.report.axes import Axis, fit_axis
from agonic.report.digits import count, group_digits, quantity, round_to_sd, show_sign, with_sd
from agonic.report.document import Document, list_sentences
from agonic.report.figure import Figure, Panel
from agonic.report.labels import unit_label
from agonic.report.marks import area, curve, dots, span, whiskers
from agonic.report.markup import Markup
from agonic.report.section import Block, Section, Table, aside, tabulate
from agonic.report.tables import NOTHING, mark

_UNITS_DAYS = {"days": 1.0, "months": 365.25 / 12, "years": 365.25}


def choose_unit(days: float) -> str:
    """Days, months or years, by how long a history is."""
    return "days" if days < 90.0 else "years" if days >= 900.0 else "months"


def draw_trends(trends: Sequence[Trend], drift: Drift) -> Figure:
    """The parameters of one kind beside each other, with a legend."""
    first = trends[0]
    return Figure(
        title=f"In {first.unit}" if first.unit else "As a ratio",
        panels=[draw_trend(one, drift) for one in trends],
        note=""
        if first.kind == "bias"
        else "To first order the same however the matrix was turned.",
        style="multiples",
    )


def draw_trend(one: Trend, drift: Drift) -> Panel:
    """One parameter over time: calibrations, the line that they follow, its bands, and steps."""
    time = np.unique(np.concatenate([sample_times(drift), one.time]))
    found = one.at(time)
    start, unit = drift.trends[0].time[0], choose_unit(np.ptp(sample_times(drift, 2)) / 86_400.0)
    scale = 86_400.0 * _UNITS_DAYS[unit]
    along, seen = ((t - start) / scale for t in (time, one.time))
    margin = 0.02 * float(along[-1])
    label = f"{unit} since {datetime.fromtimestamp(float(start), UTC):%Y-%m-%d}"
    inner, outer = (
        (found.mean - 2 * sd, found.mean + 2 * sd) for sd in (found.sd, found.calibration_sd)
    )
    bottom, top = one.value - one.sd, one.value + one.sd
    begin, end = ((at - start) / scale for at in _find_steps(one, drift))
    outlier = np.isin(np.arange(len(one.time)), [s.place for s in one.shifts if s.outlier])
    calibrated = "calibration and its standard error"
    falls = "where a calibration of usual quality falls, ± 2 sd"
    marks = [
        span("step", begin, end, words="step"),
        area("calibrations", along, *outer, words=falls),
        area("band", along, *inner, words="where it is, ± 2 sd"),
        curve("level", along, found.mean, words="parameter"),
        whiskers("sd", seen, bottom, top),
        dots("seen", seen[~outlier], one.value[~outlier], words=calibrated),
        dots("astray", seen[outlier], one.value[outlier], words="outlier"),
    ]
    return Panel(
        x=Axis(label, -margin, float(along[-1]) + margin),
        y=fit_axis(one.name, np.concatenate([*outer, bottom, top])),
        marks=marks,
        kind="small",
    )


def _find_steps(one: Trend, drift: Drift) -> Array:
    """Between which times, s, the steps lie that show in a parameter, (2, k)."""
    ends = [
        (event.after.timestamp(), event.before.timestamp())
        for event in drift.events
        if event.kind == "step" and one.name in [moved.name for moved in event.parameters]
    ]
    return np.reshape(ends, (-1, 2)).T


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
        "findings": list_sentences(drift.findings),
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
    moved: list[Block] = [_tabulate_trends(drift), aside(_COLUMNS)] if drift.trends else []
    return Document.judge(
        drift,
        schema="agonic/history@1",
        kind="History of a magnetometer",
        name=drift.sensor,
        title=title,
        key_figures=_list_key_figures(drift, trends["bias"] or drift.trends),
        entries=_list_calibrations(drift),
        entries_title="",
        sections=[
            *(
                Section(_TITLES[kind], [partial(draw_trends, of, drift)] if of else [])
                for kind, of in trends.items()
            ),
            Section("Drift", moved, printed=True),
            Section("Steps and outliers", [_tabulate_events(drift)] if drift.events else []),
            Section("Calibrations", _tabulate_calibrations(drift)),
        ],
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
        sections=[Section("", _list_sensors(rows), printed=True), _list_departures(departed)],
        values={"sensors": rows, "departures": [asdict(one) for one in departed]},
    )


# ---- all sensors ---------------------------------------------------------------------------------


def _list_sensors(rows: Sequence[Mapping[str, Any]]) -> list[Block]:
    columns: dict[str, Callable[[Mapping[str, Any]], str]] = {
        "Sensor": itemgetter("sensor"),
        "Calibrations": lambda row: str(row["calibrations"]),
        "First": lambda row: row["first"][:10],
        "Last": lambda row: row["last"][:10],
        "Verdict": itemgetter("verdict"),
        "Bias": lambda row: "drifts" if row["drifts"] else "",
    }
    more = len(rows) - MAX_LISTED
    note = [f"… and {group_digits(more)} more; --json lists all"] if more > 0 else []
    return [tabulate(rows[:MAX_LISTED], columns), *note] if rows else []


def _list_departures(departed: Sequence[Departure]) -> Section:
    title = f"{count(len({one.sensor for one in departed}), 'sensor')} left the others"
    said = [f"! {one.sensor}: {one.sentence}" for one in departed[:MAX_LISTED]]
    return Section(title, said, printed=True)


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
    return [table, *map(aside, notes)]
