"""A history for programs, as one object, and for people, as lines of text."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np

from agonic.history import Departure, Drift, Event, Trend
from agonic.population import Row, SensorSummary
from agonic.population.store_schema import UNDATED
from agonic.report.digits import counted, grouped, minused, rounded, signed, with_sd
from agonic.report.text import SIGNS, WIDTH
from agonic.report.verdict import moves, sentence

LINES = 60
"""Sensors that are listed for people; programs are told all."""
SHOWN = 12
"""Calibrations of a sensor, the last ones."""


def record(drift: Drift) -> dict[str, Any]:
    """What there is to say of one sensor."""
    return {
        "sensor": drift.sensor,
        "verdict": drift.verdict,
        "status": drift.status,
        "at": drift.at.isoformat(),
        "calibrations": [
            _calibration(row, k in drift.compared) for k, row in enumerate(drift.population)
        ],
        "trends": [_trend(one, drift.at) for one in drift.trends],
        "events": [_event(one) for one in drift.events],
        "findings": [
            {"name": f.name, "severity": f.severity, "sentence": f.sentence} for f in drift.findings
        ],
    }


def _calibration(row: Row, compared: bool) -> dict[str, Any]:
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


def _trend(one: Trend, at: datetime) -> dict[str, Any]:
    band = one.at(np.array([at.timestamp()]))
    return {
        "parameter": one.name,
        "unit": one.unit,
        "value": float(band.mean[0]),
        "sd": float(band.sd[0]),
        "calibration_sd": float(band.calibration_sd[0]),
        "slope_per_year": one.slope,
        "slope_sd_per_year": one.slope_sd,
        "p_value": one.p_value,
        "scatter": one.scatter,
        "walk_per_root_year": one.walk,
    }


def _event(event: Event) -> dict[str, Any]:
    return {
        "kind": event.kind,
        "after": event.after.isoformat(),
        "before": event.before.isoformat(),
        "p_value": event.p_value,
        "parameters": [
            {"parameter": one.name, "unit": one.unit, "size": one.size, "sd": one.sd}
            for one in event.parameters
        ],
    }


def listing(
    kept: Sequence[SensorSummary], moving: set[str], departed: Sequence[Departure]
) -> dict[str, Any]:
    """What there is to say of all sensors."""
    return {
        "sensors": [
            {
                "sensor": one.sensor,
                "calibrations": one.calibrations,
                "refused": one.refused,
                "first": one.first.isoformat(),
                "last": one.last.isoformat(),
                "verdict": one.verdict,
                "drifts": one.sensor in moving,
            }
            for one in kept
        ],
        "departures": [
            {
                "sensor": one.sensor,
                "kind": one.kind,
                "sentence": one.sentence,
                "distance": one.distance,
                "p_value": one.p_value,
            }
            for one in departed
        ],
    }


def listed(said: dict[str, Any]) -> list[str]:
    """The record of all sensors for people.

    >>> listed({"sensors": [], "departures": []})
    ['The history is empty.']
    """
    sensors = said["sensors"]
    if not sensors:
        return ["The history is empty."]
    total = sum(one["calibrations"] for one in sensors)
    width = max(6, *(len(one["sensor"]) for one in sensors[:LINES]))
    lines = [
        f"{counted(len(sensors), 'sensor')}, {counted(total, 'calibration')}",
        "",
        f"{'Sensor':<{width}}  Calibrations  First       Last        Verdict  Bias",
    ]
    for one in sensors[:LINES]:
        lines.append(
            f"{one['sensor']:<{width}}  {one['calibrations']:>12}  {one['first'][:10]}  "
            f"{one['last'][:10]}  {one['verdict']:<7}  {'drifts' if one['drifts'] else ''}".rstrip()
        )
    if len(sensors) > LINES:
        lines.append(f"… and {grouped(len(sensors) - LINES)} more; --json lists all")
    departed = said["departures"]
    if departed:
        lines += [
            "",
            f"{counted(len({one['sensor'] for one in departed}), 'sensor')} left the others",
        ]
    for one in departed[:LINES]:
        lines.append(f"! {one['sensor']}: {minused(one['sentence'])}")
    return lines


def lines(drift: Drift) -> Iterator[str]:
    """What there is to say of one sensor, for people.

    The last calibrations, each parameter with its drift, what was found, and what to do next.
    """
    yield f"{SIGNS[drift.verdict]} {drift.sensor}: {drift.verdict}"
    yield from textwrap.wrap(
        minused(drift.status), WIDTH, initial_indent="  ", subsequent_indent="  "
    )
    yield ""
    yield f"{counted(len(drift.population), 'calibration')}"
    for row in list(drift.population)[-SHOWN:]:
        yield f"  {_date(row)}  {row.verdict:<8}{_bias(row)}"
    if drift.trends:
        yield ""
        yield f"{'':10}{f'on {drift.at:%Y-%m-%d}':<30}{'drift a year':<30}scatter"
    for one in drift.trends:
        value, slope, scatter, _ = figures(one, drift.at)
        yield f"  {one.name:<9}{value:<30}{slope:<30}{scatter}".rstrip()
    for move in moves(drift.findings)[:1]:
        yield ""
        yield f"Next      {sentence(move)}"


def figures(one: Trend, at: datetime) -> tuple[str, str, str, str]:
    """A parameter at a moment, its drift in a year, scatter and walk, as people read them."""
    band = one.at(np.array([at.timestamp()]))
    unit = f" {one.unit}" if one.unit else ""
    scatter, walk = (f"{rounded(size, size)}{unit}" for size in (one.scatter, one.walk))
    value = with_sd(float(band.mean[0]), float(band.sd[0])) + unit
    slope = signed(with_sd(one.slope, one.slope_sd)) + unit
    return value, slope, scatter, walk


def _date(row: Row) -> str:
    if row.start is None:
        return " " * 11
    return f"{row.start.astimezone(UTC):%Y-%m-%d}{'*' if UNDATED.name in row.findings else ' '}"


def _bias(row: Row) -> str:
    parts = []
    for axis in "xyz":
        value, sd = getattr(row, f"bias_{axis}"), getattr(row, f"bias_{axis}_sd")
        if value is not None:
            parts.append(f"{axis} {rounded(value, sd):<11}")
    return f"bias {' '.join(parts)}{row.unit_in}  {row.source}" if parts else row.source
