"""Sensors of a dataset calibrated by their rows, as logs are."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

from agonic.errors import LogError
from agonic.fleet.one_log import explain, try_calibrate
from agonic.fleet.rows import make_refused_row, make_row
from agonic.fleet.settings import FleetSettings
from agonic.logs.large.dataset import Channel, Dataset
from agonic.logs.large.sensor_rows import Table
from agonic.logs.table import build_log
from agonic.population import Row
from agonic.provenance import Input
from agonic.recording.calibrated import Calibrated
from agonic.samples import Samples

Task = tuple[tuple[int, str, Table], ...]
"""Sensors with their place in the table, their name and their rows."""


def calibrate_by_rows(
    task: Task,
    *,
    dataset: Dataset,
    channel: Channel,
    source: Input,
    settings: FleetSettings,
    known: Mapping[str, Any],
) -> tuple[Row, ...]:
    """The row of each of these sensors, calibrated by its rows as a log is."""
    rows = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what matters is among the findings of the row
        for _, name, table in task:
            try:
                log = build_log(
                    table,
                    path=dataset.path,
                    source=source,
                    format="Parquet table",
                    unit=dataset.unit,
                )
                samples = log.sensor(channel.name)
            except LogError as error:
                why = explain(error, str(dataset.path))
                rows.append(make_refused_row(why, sensor=name, **known))
                continue
            outcome = try_calibrate(samples, settings)
            rows.append(_make_row(outcome, samples, name, known))
    return tuple(rows)


def _make_row(
    outcome: Calibrated | Exception, samples: Samples, name: str, known: Mapping[str, Any]
) -> Row:
    known = {key: value for key, value in known.items() if key != "channel"}
    if isinstance(outcome, Calibrated):
        return make_row(outcome, sensor=name, **known)
    return make_refused_row(
        explain(outcome, known["source"]), sensor=name, samples=samples, **known
    )
