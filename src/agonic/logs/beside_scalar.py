"""A scalar magnetometer beside a vector one: its readings at the rows of the other."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from agonic.errors import LogError
from agonic.logs.headers.column_names import names_for, naming_scalar
from agonic.logs.headers.columns import find_quantities
from agonic.logs.rows.auxiliary import find_reach, measure_reach
from agonic.logs.rows.resample import interpolate_smoothly
from agonic.logs.table import build_log
from agonic.logs.text.csv_text import read_table
from agonic.provenance import Input, hash_file
from agonic.samples import Samples


def read_scalar(path: Path, header: str | None = None) -> Samples:
    """The readings in a text table of a scalar magnetometer, times and `scalar`; its field is none.

    Parameters: `header` of the column, where it has no name that is known (scalar_nT).
    Raises `LogError` where there is no such column, or it names no unit.
    """
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
    intervals, before the first and after the last are left out and counted. Raises `LogError`
    where the two were never recorded at the same time, or one has no times.
    """
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
