"""The history of a sensor as numbers, for programs."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from agonic.history.result import Drift, Event
from agonic.history.trend import Trend
from agonic.population import Row
from agonic.population.store_schema import UNDATED


def list_values(drift: Drift) -> dict[str, Any]:
    """All that is known of a sensor: its calibrations, trends, events and findings."""
    rows = enumerate(drift.population)
    return {
        "sensor": drift.sensor,
        "at": drift.at.isoformat(),
        "calibrations": [_record_row(row, number in drift.compared) for number, row in rows],
        "trends": [_record_trend(one, drift.at) for one in drift.trends],
        "events": [_record_event(event) for event in drift.events],
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


def _record_trend(one: Trend, at: datetime) -> dict[str, Any]:
    mean, sd, calibration_sd = one.predict(at)
    return {
        "parameter": one.name,
        "unit": one.unit,
        "value": mean,
        "sd": sd,
        "calibration_sd": calibration_sd,
        "slope_per_year": one.slope,
        "slope_sd_per_year": one.slope_sd,
        "p_value": one.p_value,
        "scatter": one.scatter,
        "walk_per_root_year": one.walk,
    }


def _record_event(event: Event) -> dict[str, Any]:
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
