"""The attitude that another instrument recorded beside a log, at the rows of the log."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.groups import read_beside
from agonic.logs.read import open_log
from agonic.logs.rows.resample import resample
from agonic.logs.text.csv_text import read_table
from agonic.provenance import Input, hash_file
from agonic.samples import Samples

_PERIODS = {"roll_deg": 360.0, "pitch_deg": None, "heading_deg": 360.0}


def read_attitude_beside(path: Path, samples: Samples) -> tuple[Samples, Samples]:
    """The rows of samples at which another file knows the heading, and the same with its attitude.

    The file is a recording with a heading, or a table with time and heading, roll and pitch, by the
    clock of the log, or with dates where the log has them. Roll and pitch that it lacks are the
    log's own.

    Raises `LogError` where it holds no times or no heading, or the two never meet.
    """
    time, columns = _read(path)
    if samples.time is None:
        raise LogError(f"{path.name} is matched by time, and {samples.name} was logged without")
    epoch = columns.pop("epoch")
    if epoch is not None and samples.epoch is not None:
        time = time + (epoch - samples.epoch).total_seconds()
    rows = (samples.time >= time[0]) & (samples.time <= time[-1])
    if not rows.any():
        raise LogError(
            f"its times ({time[0]:.1f} to {time[-1]:.1f} s by the clock of the log) and those of "
            f"{samples.name} ({samples.time[0]:.1f} to {samples.time[-1]:.1f} s) never meet",
            path=path,
        )
    chosen = samples.select(rows)
    assert chosen.time is not None
    found = {
        name: resample(time, values, chosen.time, period=_PERIODS[name])
        for name, values in columns.items()
        if values is not None
    }
    named = {name: values for name, values in found.items() if values is not None}
    source = Input(name=path.name, sha256=hash_file(path), count=len(time))
    return chosen, chosen.with_columns(**named, heading_estimated=False, source=source)


def _read(path: Path) -> tuple[Array, dict[str, Any]]:
    """Times, and the columns of an attitude with the epoch of the times."""
    try:
        sensors = open_log(path).sensors
    except LogError as error:
        time, epoch, found = _read_table(path, error)
    else:
        with_heading = [one for one in sensors if one.heading_deg is not None]
        if not with_heading:
            raise LogError("it holds no heading (heading_deg)", path=path)
        one = with_heading[0]
        time, epoch, found = one.time, one.epoch, vars(one)
    if time is None or found.get("heading_deg") is None:
        raise LogError("a truth needs columns time_s and heading_deg", path=path)
    return time, {"epoch": epoch, **{name: found.get(name) for name in _PERIODS}}


def _read_table(path: Path, error: LogError) -> tuple[Array | None, Any, Mapping[str, Any]]:
    """The same of a table without a magnetometer."""
    try:
        table, _ = read_table(path)
    except LogError:
        raise error from None
    beside = read_beside(path.stem, table, path)
    return beside.time, beside.epoch, beside.columns
