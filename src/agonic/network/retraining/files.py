"""The retraining file: JSON that holds a network kept up to date exactly, to be resumed."""

from __future__ import annotations

from dataclasses import asdict
from datetime import datetime
from math import inf, nan
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from msgspec import Struct

from agonic.atomic import write_atomically
from agonic.calibration.encoding import decode, encode
from agonic.calibration.retraining import RetrainerParams, RetrainerState, Retraining, Window
from agonic.errors import AgonicError, LogError
from agonic.logs.contents import read_bytes
from agonic.maths.estimation.changes import cusum

Row = tuple[float, ...]
Rows = tuple[Row, ...]

SCHEMA = "agonic/retrain-state@1"


class WindowRecord(Struct, frozen=True):
    """The last readings."""

    time: Row
    raw: Rows
    wanted: Rows
    columns: dict[str, list[Any]]


class StateRecord(Struct, frozen=True, kw_only=True):
    """Where it stands; `running` is a calibration file, or null."""

    running: msgspec.Raw
    window: WindowRecord
    reservoir: WindowRecord | None = None
    covariance: Rows | None = None
    learned: int = 0
    watch: Rows
    age: tuple[tuple[int, ...], ...]
    wait: int
    noise: float | None
    correlation: float
    n: int
    time: float | None
    epoch: datetime | None
    onset: int | None
    settling: int | None
    early: bool
    since_n: int
    since_time: float | None
    due_n: int | None
    due_time: float | None
    retrainings: tuple[dict[str, Any], ...]
    accepted: int
    rejected: int
    sensor: str
    unit: str
    frame_in: str
    frame_out: str
    device_id: int | None
    reference_sd: float
    source: str


_WRITTEN_OTHERWISE = (
    *("running", "window", "reservoir", "covariance", "watch", "age"),
    *("time", "since_time", "due_n", "due_time", "retrainings"),
)
_AS_THEY_ARE = [name for name in StateRecord.__struct_fields__ if name not in _WRITTEN_OTHERWISE]


class RetrainFile(Struct, frozen=True):
    """A network that is kept up to date, made with agonic."""

    schema: str
    params: dict[str, Any]
    state: StateRecord


def save_retrainer(params: RetrainerParams, state: RetrainerState, path: Path | str) -> Path:
    """Write settings and state, every float as it is; the file replaces another in one step.

    Raises `AgonicError` where the file cannot be written.
    """
    running = msgspec.Raw(b"null" if state.running is None else encode(state.running).strip())
    record = RetrainFile(
        SCHEMA,
        asdict(params),
        StateRecord(
            running=running,
            window=_record_window(state.window),
            reservoir=_record_window(state.reservoir),
            covariance=None if state.covariance is None else _rows(state.covariance),
            watch=_rows(state.watch.size),
            age=tuple(map(tuple, state.watch.age.tolist())),
            time=state.time,  # what is not finite becomes null
            since_time=state.since_time,
            due_n=None if state.due_n == inf else int(state.due_n),
            due_time=state.due_time,
            retrainings=tuple(map(asdict, state.retrainings)),
            **{name: getattr(state, name) for name in _AS_THEY_ARE},
        ),
    )
    return write_atomically(path, msgspec.json.encode(record) + b"\n", updates=True)


def load_retrainer(path: Path | str) -> tuple[RetrainerParams, RetrainerState]:
    """Settings and state of a retraining file.

    Raises `LogError` where it is missing, damaged, something else, or made by a newer agonic.
    """
    data = read_bytes(path)
    try:
        record = msgspec.json.decode(data, type=RetrainFile)
        if record.schema != SCHEMA:
            raise LogError(f'it needs "schema": "{SCHEMA}" and has {record.schema!r}')
        return msgspec.convert(record.params, RetrainerParams), _restore_state(record.state)
    except (AgonicError, ValueError, TypeError, RecursionError) as error:
        raise LogError(f"not a usable retraining file: {error}", path=path) from None


def _restore_state(record: StateRecord) -> RetrainerState:
    text = bytes(record.running)
    running: Any = None if text == b"null" else decode(text)
    channels = len(record.watch[0])
    window = _restore_window(record.window, channels)
    return RetrainerState(
        running=running,
        window=window,
        reservoir=window.select(slice(0, 0))
        if record.reservoir is None
        else _restore_window(record.reservoir, channels),
        covariance=None if record.covariance is None else np.array(record.covariance),
        watch=cusum.Sums(
            np.array(record.watch, dtype=np.float64).reshape(2, channels),
            np.array(record.age, dtype=np.intp).reshape(2, channels),
        ),
        time=-inf if record.time is None else record.time,
        since_time=-inf if record.since_time is None else record.since_time,
        due_n=inf if record.due_n is None else record.due_n,
        due_time=inf if record.due_time is None else record.due_time,
        retrainings=tuple(_restore_retraining(one) for one in record.retrainings),
        **{name: getattr(record, name) for name in _AS_THEY_ARE},
    )


def _record_window(window: Window) -> WindowRecord:
    return WindowRecord(
        tuple(window.time.tolist()),
        _rows(window.raw),
        _rows(window.wanted),
        {name: values.tolist() for name, values in window.columns.items()},
    )


def _restore_window(record: WindowRecord, channels: int) -> Window:
    k = len(record.time)
    return Window(
        time=np.array(record.time, dtype=np.float64),
        raw=np.array(record.raw, dtype=np.float64).reshape(k, 3),
        wanted=np.array(record.wanted, dtype=np.float64).reshape(k, channels),
        columns={name: np.array(v, dtype=np.float64) for name, v in record.columns.items()},
    )


def _rows(values: np.ndarray[Any, Any]) -> Rows:
    return tuple(map(tuple, values.tolist()))


def _restore_retraining(record: dict[str, Any]) -> Retraining:
    unknown = {name: nan for name in ("running_rms", "candidate_rms") if record.get(name) is None}
    return msgspec.convert(record | unknown, Retraining)
