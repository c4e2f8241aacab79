"""The tables of a history, and how a row becomes values of them and comes back."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import UTC, datetime
from hashlib import blake2b
from operator import attrgetter
from typing import Any

import numpy as np

from agonic.health import Finding
from agonic.population.population import COLUMNS, Population, Row, get_dtype, make_column
from agonic.provenance import escape_text

APPLICATION = 0x61676E63
"""Written into the file's head, so that other SQLite files are told apart: "agnc"."""
VERSION = 1
"""Of the tables; files of a later one are left alone."""

UNDATED = Finding(
    "dated when added", "note", "the log has no date, so the date of adding is used instead"
)


def _choose_kind(name: str) -> str:
    if get_dtype(name) is np.float64:
        return "REAL"
    return "INTEGER" if name in ("rows", "device_id") else "TEXT"


KINDS = {name: _choose_kind(name) for name in COLUMNS}
CREATE = f"""
CREATE TABLE calibration (
    id INTEGER PRIMARY KEY, identity BLOB NOT NULL UNIQUE, time REAL NOT NULL, added REAL NOT NULL,
    superseded INTEGER NOT NULL DEFAULT 0,
    {", ".join(f'"{name}" {kind}' for name, kind in KINDS.items())}
);
CREATE INDEX of_sensor ON calibration (sensor, superseded, time, verdict);
"""
"""Beside the columns of a population: what makes it the same calibration, its date and the moment
of adding (seconds since 1970), and whether the same log was calibrated again later."""
INSERT = f"""
INSERT OR IGNORE INTO calibration (identity, time, added, {", ".join(COLUMNS)})
VALUES ({", ".join("?" * (3 + len(COLUMNS)))})
"""
SUPERSEDE = """
UPDATE calibration SET superseded = 1 WHERE id IN (
    SELECT old.id FROM calibration AS new JOIN calibration AS old
    ON old.sensor = new.sensor AND old.superseded = 0 AND old.time = new.time
    AND old.sha256 = new.sha256 AND old.channel = new.channel AND old.id < new.id
    WHERE new.id > ? AND new.sha256 != ''
)
"""
DATED = """
SELECT time, start FROM calibration WHERE sensor = ? AND channel = ? AND sha256 = ? LIMIT 1
"""
_VALUES = attrgetter(*COLUMNS)
SENSOR, CHANNEL, SHA256, START, FINDINGS = (
    list(COLUMNS).index(name) for name in ("sensor", "channel", "sha256", "start", "findings")
)


def make_entry(row: Row, now: datetime) -> list[Any]:
    """A row as `INSERT` takes it; one without a date is dated now, and says so."""
    values = [
        (escape_text(value) if isinstance(value, str) and not value.isascii() else value)
        for value in _VALUES(row)
    ]
    if row.key:
        identity = _digest(row.sensor, row.channel, row.key)
    elif row.sha256:
        identity = _digest(
            row.sensor, row.channel, row.sha256, row.settings, row.version, str(row.start)
        )
    else:
        identity = _digest(*map(str, values))
    findings, when = row.findings, row.start
    if when is None:
        findings, when = (*findings, UNDATED.name), now
    elif when.tzinfo is None:
        when = when.replace(tzinfo=UTC)
    values[START] = when.isoformat()
    values[FINDINGS] = json.dumps(findings) if findings else "[]"
    return [identity, when.timestamp(), now.timestamp(), *values]


def make_population(values: Sequence[Sequence[Any]]) -> Population:
    """The population of rows as they are stored, in their order."""
    columns = dict(
        zip(COLUMNS, list(zip(*values, strict=True)) or [()] * len(COLUMNS), strict=True)
    )
    columns["start"] = tuple(map(datetime.fromisoformat, columns["start"]))
    columns["findings"] = tuple(tuple(json.loads(value)) for value in columns["findings"])
    return Population({name: make_column(name, column) for name, column in columns.items()})


def _digest(*parts: str) -> bytes:
    return blake2b(escape_text("\0".join(parts)).encode(), digest_size=16).digest()
