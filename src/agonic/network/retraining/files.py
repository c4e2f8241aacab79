"""The retraining file: JSON that holds a network kept up to date exactly, to be resumed."""

from __future__ import annotations

from dataclasses import asdict
from math import inf, nan
from pathlib import Path
from typing import Any, get_type_hints

import msgspec
import numpy as np
from msgspec import Struct, convert

from agonic.arrays import Array
from agonic.atomic import write_atomically
from agonic.calibration.encoding import decode, encode
from agonic.calibration.retraining import RetrainerParams, RetrainerState, Retraining, Window
from agonic.errors import LogError
from agonic.files.states import as_array, load_state
from agonic.maths.estimation.changes import cusum

SCHEMA = "agonic/retrain-state@1"
_ENDLESS = {"time": -inf, "since_time": -inf, "due_n": inf, "due_time": inf}
"""Moments that stand as null in the file before there is one."""
_LATER = ("covariance", "reservoir", "learned")
"""What files from before it was kept have none of."""


class RetrainFile(Struct, frozen=True):
    """A network that is kept up to date, made with agonic."""

    schema: str
    params: dict[str, Any]
    state: dict[str, Any]


def save_retrainer(params: RetrainerParams, state: RetrainerState, path: Path | str) -> Path:
    """Write settings and state, every float as it is; the file replaces another in one step.

    Raises `AgonicError` where the file cannot be written.
    """
    running = msgspec.Raw(b"null" if state.running is None else encode(state.running).strip())
    written = {"running": running, "watch": state.watch.size, "age": state.watch.age}
    if state.due_n < inf:
        written["due_n"] = int(state.due_n)
    record = RetrainFile(SCHEMA, asdict(params), vars(state) | written)
    content = msgspec.json.encode(record, enc_hook=np.ndarray.tolist)  # no number becomes null
    return write_atomically(path, content + b"\n", updates=True)


def load_retrainer(path: Path | str) -> tuple[RetrainerParams, RetrainerState]:
    """Settings and state of a retraining file.

    Raises `LogError` where it is missing, damaged, something else, or made by a newer agonic.
    """
    return load_state(path, RetrainFile, SCHEMA, "retraining file", _restore)


def _restore(record: RetrainFile) -> tuple[RetrainerParams, RetrainerState]:
    given, kinds = record.state, get_type_hints(RetrainerState)
    for name in kinds:
        if name not in given and name not in _LATER:
            raise LogError(f"the state has no `{name}`")
    running: Any = given["running"]
    channels = len(given["watch"][0])
    nothing: dict[str, Any] = {name: [] for name in ("time", "raw", "wanted")} | {"columns": {}}
    windows = {
        name: _restore_window(given.get(name) or nothing, channels)
        for name in ("window", "reservoir")
    }
    unknown = ("running_rms", "candidate_rms")
    parts: dict[str, Any] = windows | {
        "running": None if running is None else decode(msgspec.json.encode(running)),
        "watch": cusum.Sums(
            as_array(Array, given["watch"]).reshape(2, channels),
            np.array(given["age"], dtype=np.intp).reshape(2, channels),
        ),
        "retrainings": tuple(
            convert(one | {n: nan for n in unknown if one.get(n) is None}, Retraining)
            for one in given["retrainings"]
        ),
    }
    given |= {name: none for name, none in _ENDLESS.items() if given[name] is None}
    plain = {
        name: convert(value, kinds[name], dec_hook=as_array)
        for name, value in given.items()
        if name in kinds and name not in parts
    }
    return convert(record.params, RetrainerParams), RetrainerState(**plain, **parts)


def _restore_window(record: dict[str, Any], channels: int) -> Window:
    k = len(record["time"])
    return Window(
        time=as_array(Array, record["time"]),
        raw=as_array(Array, record["raw"]).reshape(k, 3),
        wanted=as_array(Array, record["wanted"]).reshape(k, channels),
        columns={name: as_array(Array, values) for name, values in record["columns"].items()},
    )
