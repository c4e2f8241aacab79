"""Reading ArduPilot dataflash logs, `.bin` and `.log`.

The magnetometers come out as their sensors measured them, turned to body axes: the corrections
that the autopilot had applied are taken out and kept as `logged`. Roll, pitch and heading are
those of the autopilot; altitude is above mean sea level, at most 0.1 km from the ellipsoid.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.ardupilot.dataflash_binary import Content, Table, read_binary
from agonic.logs.ardupilot.dataflash_text import read_text
from agonic.logs.ardupilot.parameters import remove_correction
from agonic.logs.formats import FMT_TEXT, HEAD_BYTES
from agonic.logs.log import Log
from agonic.logs.resample import ESTIMATED_ATTITUDE, find_misplaced, resample
from agonic.provenance import Input
from agonic.samples import Samples

Tables = Mapping[str, Table]

MAGNETOMETERS = ("MAG", "MAG2", "MAG3")
WANTED = (
    *MAGNETOMETERS,
    "PARM",
    "VER",
    "MSG",
    "ATT",
    "IMU",
    "GPS",
    "POS",
    "BAT",
    "CURR",
    "CTUN",
)

SCHEMA = ("FMT", "FMTU", "UNIT", "MULT")
"""Messages that describe messages."""

GPS_EPOCH = datetime(1980, 1, 6, tzinfo=UTC)
LEAP_SECONDS = {
    datetime(2006, 1, 1, tzinfo=UTC): 14,
    datetime(2009, 1, 1, tzinfo=UTC): 15,
    datetime(2012, 7, 1, tzinfo=UTC): 16,
    datetime(2015, 7, 1, tzinfo=UTC): 17,
    datetime(2017, 1, 1, tzinfo=UTC): 18,
}
"""GPS − UTC, and since when (IERS Bulletin C)."""

_FIRST_WEEK = 1356  # that of 2006-01-01; before there were such logs
_LONGEST_RUN_S = 1e8  # three years; what lies above is damage
_FIRMWARE = re.compile(r"^(APM:|Ardu|Blimp|AntennaTracker)\S* V\d")


def read(path: Path, source: Input) -> Log:
    """The magnetometers of a dataflash log with all that was recorded beside them.

    Raises `LogError` where the file is no such log or holds no magnetometer.
    """
    with path.open("rb") as stream:
        text = FMT_TEXT.search(stream.read(HEAD_BYTES))
    content = (read_text if text else read_binary)(path, WANTED)
    return build_tables_log(content, path, source, "ArduPilot dataflash")


def build_tables_log(content: Content, path: Path, source: Input, format: str) -> Log:
    """The log that tables of messages are.

    Raises `LogError` where none of them is of a magnetometer.
    """
    tables = content.tables
    sensors = tuple(_read_samples(*mag, tables, source) for mag in _find_magnetometers(tables))
    if not sensors:
        reasons = f" ({'; '.join(content.notes)})" if content.notes else ""
        raise LogError(
            f"holds no MAG messages{reasons}; set the compass bit of LOG_BITMASK and record again",
            path=path,
        )
    return Log(
        path=path,
        format=format,
        source=source,
        sensors=sensors,
        stack="ardupilot",
        streams=tuple(s for s in content.streams if s.name not in (*MAGNETOMETERS, *SCHEMA)),
        notes=(*find_firmware(tables), *content.notes),
    )


def _find_magnetometers(tables: Tables) -> Iterator[tuple[str, str, Table]]:
    """Name, number in the parameter names, and messages of each compass."""
    for name in MAGNETOMETERS:
        mag = tables.get(name)
        if mag is None:
            continue
        instance = mag.get("I")
        if instance is None:
            yield name, name.removeprefix("MAG"), mag
        else:
            for i in sorted(int(i) for i in set(instance.tolist()) if math.isfinite(i)):
                yield f"{name}[{i}]", str(i + 1) if i else "", mag.select(instance == i)


def _parameters(tables: Tables) -> Table:
    """The PARM messages; a table without rows where they are not in the log."""
    table = tables.get("PARM")
    if table is None or not {"Name", "Value"} <= set(table.columns):
        return Table(np.empty(0, np.int64), {"Name": np.empty(0, "S16"), "Value": np.empty(0)})
    return table


def _read_samples(name: str, slot: str, mag: Table, tables: Tables, source: Input) -> Samples:
    """One compass, with everything else at its rows."""
    boot = mag.time_s
    wrong = np.zeros(len(mag), dtype=bool) if boot is None else find_misplaced(boot)
    mag = mag.select(~wrong)
    found = remove_correction(mag, _parameters(tables), slot)
    columns = resample_columns(mag, tables)
    notes = [*found.notes]
    if columns["heading_deg"] is not None:
        notes.append(ESTIMATED_ATTITUDE)
    if boot is None:
        notes.append("the messages carry no time: columns meet by place in the file")
    gps = tables.get("GPS")
    return Samples(
        field=found.field,
        unit="nT",
        time=mag.time_s,
        epoch=None if gps is None else _utc_of_boot(gps),
        **columns,
        name=name,
        frame="b",
        device_id=found.device_id,
        heading_estimated=columns["heading_deg"] is not None,
        logged=found.logged,
        notes=tuple(notes),
        source=replace(source, count=len(mag)),
        rejected={"time out of sequence": int(wrong.sum())} if wrong.any() else {},
    )


def resample_columns(mag: Table, tables: Tables) -> dict[str, Any]:
    """Attitude, motion, power and place at the rows of the magnetometer."""
    attitude, control = tables.get("ATT"), tables.get("CTUN")
    imu, battery = _first_instance(tables, "IMU"), _first_instance(tables, "BAT", "CURR")
    throttle, full = _throttle(control)
    fixes = _fixes(tables)
    return {
        "roll_deg": _resample_onto(mag, attitude, "Roll", period=360.0),
        "pitch_deg": _resample_onto(mag, attitude, "Pitch", period=360.0),
        "heading_deg": _resample_onto(mag, attitude, "Yaw", period=360.0),
        "acceleration": _resample_onto(mag, imu, "AccX", "AccY", "AccZ"),
        "rotation_rate": _resample_onto(mag, imu, "GyrX", "GyrY", "GyrZ"),
        "current_A": _resample_onto(mag, battery, "Curr", per_unit=_per_ampere(battery)),
        "throttle": _resample_onto(mag, control, throttle, per_unit=full),
        "latitude_deg": _resample_onto(mag, fixes, "Lat"),
        "longitude_deg": _resample_onto(mag, fixes, "Lng", period=360.0),
        "altitude_m": _resample_onto(mag, fixes, "Alt"),
    }


def _resample_onto(
    mag: Table,
    other: Table | None,
    *names: str,
    period: float | None = None,
    per_unit: float = 1.0,
) -> Array | None:
    """Columns of another message at the rows of `mag`; without times, by place in the file."""
    if other is None or not set(names) <= set(other.columns):
        return None
    values = np.stack([other.columns[name] for name in names], axis=1) / per_unit
    here, there = mag.time_s, other.time_s
    if here is None or there is None:
        here, there = mag.position.astype(float), other.position.astype(float)
    return resample(there, values if len(names) > 1 else values[:, 0], here, period=period)


def _first_instance(tables: Tables, *names: str) -> Table | None:
    """The messages of the first instance, of the first of these names that is there."""
    table = next((tables[name] for name in names if name in tables), None)
    instance = None if table is None else table.get("I", "Inst", "Instance")
    if table is None or instance is None:
        return table
    return table.select(instance == instance.min())


def _per_ampere(battery: Table | None) -> float:
    """Old CURR messages hold hundredths of an ampere as a whole number."""
    return 100.0 if battery is not None and "Curr" in battery.integer else 1.0


def _throttle(control: Table | None) -> tuple[str, float]:
    """The column of the throttle and its full scale.

    Plane and Rover log percent, Copter and Sub 0…1, or 0…1000 as a whole number.
    """
    if control is None:
        return "", 1.0
    name = "ThO" if "ThO" in control.columns else "ThrOut"
    if "NavRoll" in control.columns or "Steer" in control.columns:
        return name, 100.0
    return name, 1000.0 if name in control.integer else 1.0


def _fixes(tables: Tables) -> Table | None:
    """Where the vehicle was: GPS messages with a three-dimensional fix, else estimates (POS)."""
    for name in ("GPS", "POS"):
        table = _first_instance(tables, name)
        if table is None or not {"Lat", "Lng", "Alt"} <= set(table.columns):
            continue
        latitude, longitude = table.columns["Lat"], table.columns["Lng"]
        real = (np.abs(latitude) <= 90) & (np.abs(longitude) <= 180) & (latitude != 0)
        status = table.get("Status")
        if status is not None:
            real &= status >= 3
        if real.any():
            return table.select(real)
    return None


def _utc_of_boot(gps: Table) -> datetime | None:
    """The median over the GPS messages that know the time, less the seconds since boot."""
    week, milliseconds, boot = gps.get("GWk", "Week"), gps.get("GMS", "TimeMS"), gps.time_s
    if week is None or milliseconds is None or boot is None:
        return None
    known = (week >= _FIRST_WEEK) & (boot < _LONGEST_RUN_S)
    if not known.any():
        return None
    moment = week[known] * 604800.0 + milliseconds[known] / 1e3
    utc = GPS_EPOCH + timedelta(seconds=float(np.median(moment - boot[known])))
    leap = [seconds for month, seconds in LEAP_SECONDS.items() if month <= utc]
    return utc - timedelta(seconds=leap[-1]) if leap else None


def find_firmware(tables: Tables) -> tuple[str, ...]:
    """The version of the autopilot, from its version or its first messages."""
    for name, column in (("VER", "FWS"), ("MSG", "Message")):
        if name in tables and column in tables[name].columns:
            for text in tables[name].columns[column].tolist():
                if _FIRMWARE.match(words := text.decode("ascii", "replace")):
                    return (f"firmware {words.removeprefix('APM:')}",)
    return ()
