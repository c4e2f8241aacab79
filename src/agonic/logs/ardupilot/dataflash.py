"""Reading ArduPilot dataflash logs, `.bin` and `.log`.

The magnetometers come out as their sensors measured them, turned to body axes: the corrections
that the autopilot had applied are taken out and kept as `logged`. Roll, pitch and heading are
those of the autopilot; altitude is above mean sea level, at most 0.1 km from the ellipsoid.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agonic.errors import LogError
from agonic.logs.ardupilot import compass
from agonic.logs.ardupilot.compass import remove_correction
from agonic.logs.ardupilot.dataflash_binary import INTEGERS, TEXTS, Content, read_binary
from agonic.logs.contents import to_number
from agonic.logs.formats import FMT_TEXT, HEAD_BYTES
from agonic.logs.log import Facts, Log, Stream
from agonic.logs.rows.auxiliary import find_misplaced
from agonic.logs.rows.calendar import GPS_EPOCH, gps_utc_s
from agonic.logs.rows.tracks import LONGEST_RUN_S, Table, Tables, build_samples
from agonic.provenance import Input
from agonic.samples import Samples

MAGNETOMETERS = ("MAG", "MAG2", "MAG3")
_BESIDE = ("PARM", "VER", "MSG", "ATT", "IMU", "GPS", "GPA", "POS", "BAT", "CURR", "CTUN")
WANTED = (*MAGNETOMETERS, *_BESIDE, *compass.YAW_ESTIMATORS, *compass.DISTURBERS)
SCHEMA = ("FMT", "FMTU", "UNIT", "MULT")
"""Messages that describe messages."""

_FIRMWARE = re.compile(r"^(APM:|Ardu|Blimp|AntennaTracker)\S* V\d")
_LABEL = "_label"
_LINE = ("LineNo", "linenumber", "Line")
_WORDS = ("MSG", "VER")
"""Messages of texts, for which a file of MATLAB holds zeros."""


def read(path: Path, source: Input) -> Log:
    """The magnetometers of a dataflash log with all that was recorded beside them."""
    with path.open("rb") as stream:
        text = FMT_TEXT.search(stream.read(HEAD_BYTES))
    content = (read_text if text else read_binary)(path, WANTED)
    return build_tables_log(content, path, source, "ArduPilot dataflash")


def build_tables_log(content: Content, path: Path, source: Input, format: str) -> Log:
    """The log that tables of messages are; `LogError` where none of them is of a magnetometer."""
    tables = content.tables
    sensors = tuple(_read_samples(*mag, tables, source) for mag in _find_magnetometers(tables))
    if not sensors:
        reasons = f" ({'; '.join(content.notes)})" if content.notes else ""
        raise LogError(
            f"holds no MAG messages{reasons}; set the compass bit of LOG_BITMASK and record again",
            path=path,
        )
    facts = Facts(path=path, source=source, format=format)
    streams = [s for s in content.streams if s.name not in (*MAGNETOMETERS, *SCHEMA)]
    notes = (*find_firmware(tables), *content.notes)
    return Log.of(facts, sensors, streams, notes, "ardupilot")


def _find_magnetometers(tables: Tables) -> Iterator[tuple[str, str, Table]]:
    """Name, number in the parameter names, and messages of each compass."""
    for name in MAGNETOMETERS:
        if (mag := tables.get(name)) is None:
            continue
        if (instance := mag.get("I")) is None:
            yield name, name.removeprefix("MAG"), mag
            continue
        for i in sorted(int(i) for i in set(instance.tolist()) if math.isfinite(i)):
            yield f"{name}[{i}]", str(i + 1) if i else "", mag.select(instance == i)


def _read_samples(name: str, slot: str, mag: Table, tables: Tables, source: Input) -> Samples:
    """One compass, with everything else at its rows."""
    boot = mag.time_s
    wrong = np.zeros(len(mag), dtype=bool) if boot is None else find_misplaced(boot)
    mag = mag.select(~wrong)
    parameters = tables.get("PARM")
    if parameters is None or not {"Name", "Value"} <= set(parameters.columns):
        none = {"Name": np.empty(0, "S16"), "Value": np.empty(0)}
        parameters = Table(np.empty(0, np.int64), none)
    samples = build_samples(
        name,
        remove_correction(mag, parameters, slot),
        compass.list_tracks(mag, tables),
        time=mag.time_s,
        epoch=_utc_of_boot(tables.get("GPS")),
        source=source,
        rejected={"time out of sequence": int(wrong.sum())},
        headings=compass.list_headings(tables),
    )
    if boot is not None:
        return samples
    placed = "the messages carry no time: columns are matched by their place in the file"
    return samples.with_columns(notes=(*samples.notes, placed))


def _utc_of_boot(gps: Table | None) -> datetime | None:
    """The median over the GPS messages that know the time, less the seconds since boot."""
    if gps is None:
        return None
    week, milliseconds, boot = gps.get("GWk", "Week"), gps.get("GMS", "TimeMS"), gps.time_s
    if week is None or milliseconds is None or boot is None:
        return None
    known = (week >= 1356) & (boot < LONGEST_RUN_S)  # from 2006 on there are such logs
    if not known.any():
        return None
    moment = week[known] * 604800.0 + milliseconds[known] / 1e3
    utc = GPS_EPOCH + timedelta(seconds=float(np.median(moment - boot[known])))
    return utc - timedelta(seconds=gps_utc_s(utc.timestamp()))


def find_firmware(tables: Tables) -> tuple[str, ...]:
    """The version of the autopilot, from its version or its first messages."""
    said = (text.decode("ascii", "replace") for text in compass.list_texts(tables))
    words = next(filter(_FIRMWARE.match, said), None)
    return () if words is None else (f"firmware {words.removeprefix('APM:')}",)


Lines = list[tuple[int, list[str]]]


def read_text(path: Path, wanted: Collection[str]) -> Content:
    """The wanted messages of a `.log` file; lines that are too short are left out."""
    lines: dict[str, Lines] = {}
    for number, line in enumerate(path.read_text("latin-1").splitlines()):
        name, *values = (part.strip() for part in line.split(","))
        lines.setdefault(name, []).append((number, values))
    tables = {}
    for _, (_, _, name, letters, *columns) in _whole(lines.get("FMT", []), 5):
        if rows := _whole(lines.get(name, []), len(columns)):
            tables[name] = _make_columns(rows, letters, columns)
    return Content(
        {name: tables[name] for name in wanted if name in tables},
        tuple(Stream.at(name, len(table), table.time_s) for name, table in tables.items()),
    )


def _whole(lines: Lines, n: int) -> Lines:
    return [(number, values) for number, values in lines if len(values) >= n]


def _make_columns(lines: Lines, letters: str, names: list[str]) -> Table:
    """The table of lines; NaN where a damaged one holds no number."""
    columns: dict[str, NDArray[Any]] = {}
    for k, (letter, name) in enumerate(zip(letters, names, strict=False)):
        column = [values[k] for _, values in lines]
        texts = letter in TEXTS + "M"  # modes are written by name
        columns[name] = np.array([v.encode() if texts else to_number(v) for v in column])
    integer = (n for n, letter in zip(names, letters, strict=False) if letter in INTEGERS)
    return Table(np.array([number for number, _ in lines]), columns, frozenset(integer))


def is_labelled(contents: Mapping[str, Any]) -> bool:
    """Whether the variables of a file are messages with labels, one of them a magnetometer's."""
    names = (*MAGNETOMETERS, *(f"MAG_{k}" for k in range(4)))
    return any(name in contents and f"{name}{_LABEL}" in contents for name in names)


def read_labelled(contents: Mapping[str, Any], path: Path, source: Input) -> Log:
    """The log that messages with labels are."""
    tables: dict[str, Table] = {}
    notes: tuple[str, ...] = ()
    for name, values in contents.items():
        table = _make_table(values, contents.get(f"{name}{_LABEL}"))
        if table is not None and name not in _WORDS:
            tables[name] = table
    if (parameters := _read_parameters(contents.get("PARM"))) is not None:
        tables["PARM"] = parameters
    elif "PARM" not in tables:
        notes = ("no parameters in the file: corrections beside the offsets are not known",)
    tables = _join_instances(tables)
    streams = tuple(Stream.at(name, len(table), table.time_s) for name, table in tables.items())
    wanted = {name: table for name, table in tables.items() if name in WANTED}
    content = Content(wanted, streams, notes)
    return build_tables_log(content, path, source, "ArduPilot log in MATLAB")


def _make_table(values: Any, labels: Any) -> Table | None:
    """The table of one message; `None` where matrix and labels do not fit."""
    if not isinstance(values, np.ndarray) or not isinstance(labels, list):
        return None
    names = [label.strip() for label in labels if isinstance(label, str)]
    rows = np.atleast_2d(values).astype(np.float64)
    if len(names) != len(labels) or rows.ndim != 2 or rows.shape[1] != len(names):
        return None
    columns = dict(zip(names, rows.T, strict=True))
    line = next((columns.pop(name) for name in _LINE if name in columns), np.arange(len(rows)))
    return Table(line.astype(np.int64), columns)


def _read_parameters(cells: Any) -> Table | None:
    """The table of the parameters in a cell array, names first, all from the start of the log."""
    if not isinstance(cells, list):
        return None
    names = [cell.strip().encode() for cell in cells if isinstance(cell, str)]
    values = [float(cell) for cell in cells if isinstance(cell, np.ndarray) and cell.size == 1]
    if not names or len(names) != len(values):
        return None
    columns = {"Name": np.array(names), "Value": np.array(values)}
    return Table(np.zeros(len(names), np.int64), columns)


def _join_instances(tables: Mapping[str, Table]) -> dict[str, Table]:
    """The tables, with `NAME_0`, `NAME_1` as one table whose column `I` tells them apart."""
    joined = dict(tables)
    for first in [name for name in tables if name.endswith("_0")]:
        stem = first.removesuffix("_0")
        parts = [tables[f"{stem}_{k}"] for k in range(8) if f"{stem}_{k}" in tables]
        shared = set.intersection(*(set(part.columns) for part in parts))
        numbers = np.concatenate([np.full(len(part), float(k)) for k, part in enumerate(parts)])
        columns = {c: np.concatenate([part.columns[c] for part in parts]) for c in shared}
        position = np.concatenate([part.position for part in parts])
        joined.setdefault(stem, Table(position, {**columns, "I": numbers}))
    return joined
