"""What another instrument recorded beside a log, at its rows: an attitude, or the readings
of a scalar magnetometer."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.errors import LogError
from agonic.logs.groups import read_beside
from agonic.logs.headers.column_names import names_for, naming_scalar
from agonic.logs.headers.columns import find_quantities
from agonic.logs.read import open_log
from agonic.logs.rows.auxiliary import (
    ATTITUDE,
    PERIODS_DEG,
    find_reach,
    interpolate_smoothly,
    measure_reach,
    resample,
)
from agonic.logs.table import build_log
from agonic.logs.text.csv_text import read_table
from agonic.provenance import Input, hash_file
from agonic.samples import Samples


def read_attitude_beside(path: Path, samples: Samples) -> tuple[Samples, Samples]:
    """The rows of samples at which another file knows the heading, and the same with its attitude.
    The file is a recording with a heading, or a table with time and heading, roll and pitch, by the
    clock of the log, or with dates where the log has them. Roll and pitch that it lacks are the
    log's own."""
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
        name: resample(time, values, chosen.time, period=PERIODS_DEG[name])
        for name, values in columns.items()
        if values is not None
    }
    named = {name: values for name, values in found.items() if values is not None}
    source = Input(name=path.name, sha256=hash_file(path), count=len(time))
    return chosen, chosen.with_columns(**named, heading_estimated=False, source=source)


def _read(path: Path) -> tuple[Array, dict[str, Any]]:
    """Times, and the columns of an attitude with the epoch of the times."""
    found: Mapping[str, Any]
    try:
        sensors = open_log(path).sensors
    except LogError as error:  # a table without a magnetometer
        try:
            table, _ = read_table(path)
        except LogError:
            raise error from None
        beside = read_beside(path.stem, table, path)
        time, epoch, found = beside.time, beside.epoch, beside.columns
    else:
        one = next((one for one in sensors if one.heading_deg is not None), None)
        if one is None:
            raise LogError("it holds no heading (heading_deg)", path=path)
        time, epoch, found = one.time, one.epoch, vars(one)
    if time is None or found.get("heading_deg") is None:
        raise LogError("a truth needs columns time_s and heading_deg", path=path)
    return time, {"epoch": epoch, **{name: found.get(name) for name in ATTITUDE}}


def read_scalar(path: Path, header: str | None = None) -> Samples:
    """The readings in a text table of a scalar magnetometer, times and `scalar`; its field is none.
    Parameters: `header` of the column, where it has no name that is known (scalar_nT). Raises
    `LogError` where there is no such column, or it names no unit."""
    with naming_scalar(header), names_for(path, None):
        table, facts = read_table(path)
    named = find_quantities(table)
    if "scalar" not in named.values():
        among = ", ".join(table) or "none that is known"
        raise LogError(
            f"no column of a scalar magnetometer among {among}: name it, {path.name}:F_nT, or call "
            "it scalar_nT",
            path=path,
        )
    columns = {name: values for name, values in table.items() if named[name] != "field"}
    rows = len(next(iter(columns.values())))
    columns |= {f"mag_{axis}_nT": np.ones(rows) for axis in "xyz"}  # for `build_log` alone
    source = Input(name=path.name, sha256=hash_file(path), count=rows)
    found = build_log(columns, path=path, source=source, format=facts["format"]).sensors[0]
    if found.scalar is None:
        why = next((note for note in found.notes if note.startswith("scalar left out")), "")
        raise LogError(f"{why or 'no scalar reading'}; write it in the header: F_nT", path=path)
    return found


def join_scalar(samples: Samples, other: Samples) -> Samples:
    """The samples of a vector magnetometer with the scalar readings of another log beside them.
    They are interpolated between readings; rows in a gap of more than one and a half usual
    intervals, before the first and after the last are left out and counted. Raises `LogError` where
    the two were never recorded at the same time, or one has no times."""
    if samples.time is None or other.time is None or other.scalar is None:
        raise LogError("a vector and a scalar magnetometer meet by their times; both need them")
    time = other.time
    if samples.epoch is not None or other.epoch is not None:
        time = other.seconds_since(samples.epoch)
    inside = (samples.time >= time[0]) & (samples.time <= time[-1])
    rows = inside & (measure_reach(time, samples.time) <= find_reach("scalar", time))
    if not rows.any():
        raise LogError(
            f"{samples.name} and the scalar instrument were never recorded at the same time: "
            f"{samples.time[0]:.6g} to {samples.time[-1]:.6g} s and {time[0]:.6g} to "
            f"{time[-1]:.6g} s; check their clocks"
        )
    kept = samples.select(rows)
    assert kept.time is not None
    left_out = {} if rows.all() else {"no reading of the scalar instrument": int((~rows).sum())}
    scalar = interpolate_smoothly(kept.time, time, other.scalar)
    return kept.with_columns(scalar=scalar, rejected={**samples.rejected, **left_out})
