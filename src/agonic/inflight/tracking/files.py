"""The track file: JSON that holds a followed calibration exactly, to be resumed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, fields, is_dataclass
from operator import attrgetter
from pathlib import Path
from typing import Any, get_type_hints

import msgspec
import numpy as np
from msgspec import Struct, convert

from agonic.arrays import Array
from agonic.atomic import write_atomically
from agonic.calibration.affine import Affine
from agonic.calibration.interference import Interference
from agonic.calibration.thermal import Thermal
from agonic.calibration.tracking import Recent, TrackerParams, TrackerState
from agonic.errors import AgonicError, LogError
from agonic.files.states import as_array, load_state
from agonic.maths.estimation.filters.jump_test import SCALE, TIME, USUAL, WATCHED
from agonic.maths.estimation.filters.states import TABLES, FilterState
from agonic.maths.estimation.noise import running_batch_means
from agonic.maths.estimation.noise.running_batch_means import RunningBatchMeans
from agonic.maths.rotations.polar import split_rotation

Row = tuple[float, ...]
Rows = tuple[Row, ...]


class FilterRecord(Struct, frozen=True):
    """State, factors of its covariance, and what the filter watches."""

    state: Row
    columns: Rows
    diagonal: Row
    watch: Row
    batches: dict[str, Any] | None = None


class TrackFile(Struct, frozen=True):
    """A calibration followed in time, made with agonic."""

    schema: str
    params: dict[str, Any]
    state: dict[str, Any]
    history: Rows


SCHEMA = "agonic/track-state@1"


_NAMES = ("unit_in", "gauge", "noise", "sensor", "device_id", "frame_in", "frame_out")
"""What the calibrations of a state have in common."""
_BOTH = ("bias", "matrix", "covariance")
_KEPT: dict[type, tuple[str, ...]] = {
    Affine: (*_BOTH, "model", *_NAMES, "parents"),
    Thermal: (*_BOTH, "centre_C", "half_range_C", "rate", "temperature_C"),
    Interference: (*_BOTH, "sources", "coefficients", "typical", "second_sensor"),
    FilterState: ("state", "columns", "diagonal", "watch", "batches"),
    RunningBatchMeans: tuple(name for name in RunningBatchMeans._fields if name != "unsummed"),
    TrackerState: tuple(f.name for f in fields(TrackerState) if f.name != "turned"),
}
"""What is kept of a part of the state; of others all."""
_IN_FILE = {"outliers": "strays", "estimate": "belief"}
_IN_STATE = {name: known for known, name in _IN_FILE.items()}
_IN_FILES = (*range(SCALE + 1), TIME, USUAL)
"""What a filter without a gyro watches, in the order of the file."""
_ELSEWHERE: dict[str, Callable[[Any], Any]] = {
    "watch": lambda one: one.watch if one.beside_gyro else one.watch[list(_IN_FILES)],
    "batches": lambda one: running_batch_means.sum_up(one.batches),
    "parents": attrgetter("provenance.parents"),
    "temperature_C": attrgetter("validity.temperature_C"),
}


def save_track(
    params: TrackerParams, state: TrackerState, history: Array, path: Path | str
) -> Path:
    """Write a followed calibration so that `load_track` gives it back float for float.

    `history` (k, 7): time, bias and its standard error. Raises `AgonicError` before the first
    reading, or where the file cannot be written.
    """
    if state.n == 0:
        raise AgonicError("nothing has been followed yet; update the tracker before saving it")
    record = TrackFile(SCHEMA, asdict(params), _plain(state), history.tolist())
    return write_atomically(path, msgspec.json.encode(record) + b"\n", updates=True)


def load_track(path: Path | str) -> tuple[TrackerParams, TrackerState, Array]:
    """Settings, state and history of a track file.

    Raises `LogError` where it is missing, damaged, something else, or made by a newer agonic.
    """
    return load_state(path, TrackFile, SCHEMA, "track file", _restore)


def _restore(record: TrackFile) -> tuple[TrackerParams, TrackerState, Array]:
    params = convert(record.params, TrackerParams)
    return params, _restore_state(record.state), np.array(record.history).reshape(-1, 7)


def _plain(value: Any) -> Any:
    """Arrays as lists, and parts of the state as what is kept of them, by its names in the file."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    own = [f.name for f in fields(value)] if is_dataclass(value) else ()
    names = _KEPT.get(type(value), getattr(value, "_fields", own))
    if names:
        find = ((name, _ELSEWHERE.get(name, attrgetter(name))) for name in names)
        return {_IN_FILE.get(name, name): _plain(get(value)) for name, get in find}
    return [_plain(one) for one in value] if isinstance(value, tuple) else value


def _restore_state(state: dict[str, Any]) -> TrackerState:
    """The state; what a file from before something was kept leaves out is as by default."""
    kinds = get_type_hints(TrackerState)
    given = {_IN_STATE.get(name, name): value for name, value in state.items()}
    base = given["base"]
    base["provenance"] = {"parents": base["parents"]}
    named = {name: base[name] for name in (*_NAMES, "provenance")}
    for name in ("ground", "aboard"):
        if (part := given.get(name)) is not None:
            given[name] = part | named | {"validity": {"temperature_C": part.get("temperature_C")}}
    values = {
        name: convert(_restore_parts(part), kinds[name], dec_hook=as_array)
        for name, part in given.items()
        if name in kinds
    }
    base = values["base"]
    turned = split_rotation(base.matrix, base.covariance, base.gauge)[1]
    return TrackerState(**values, turned=turned)


def _restore_parts(part: Any) -> Any:
    """A part of the state with its filters, and its rows as wide as those have them."""
    if not isinstance(part, dict):
        return part
    if "diagonal" in part:
        return _restore_filter(convert(part, FilterRecord))
    values = {_IN_STATE.get(name, name): _restore_parts(value) for name, value in part.items()}
    if "rows" in values:
        filters = [one for one in values.values() if isinstance(one, FilterState)]
        values["rows"] = as_array(Array, values["rows"]).reshape(-1, filters[0].table.row)
    if values.keys() == set(Recent._fields):
        return [values[name] for name in Recent._fields]  # as msgspec has a named tuple
    return values


def _restore_filter(record: FilterRecord) -> FilterState:
    size, m = len(record.state), len(record.diagonal)
    if size not in TABLES or not 0 < m <= size or np.shape(record.columns) != (m, m):
        raise LogError(f"an estimate has {size} numbers and {m} of its covariance")
    watched = list(record.watch)
    if size == min(TABLES) and len(_IN_FILES) - len(watched) in (0, 1):  # of files before `USUAL`
        given = dict(zip(_IN_FILES, [*watched, 1.0], strict=False))
        watched = [given.get(k, 0.0) for k in range(WATCHED)]
    if len(watched) != WATCHED:
        raise LogError(f"an estimate watches {len(watched)} sums")
    batched = TABLES[size].batched
    return FilterState(
        list(record.state),
        [list(line) for line in record.columns],
        list(record.diagonal),
        watched,
        _restore_batches(record.batches, batched.stop - batched.start),
    )


def _restore_batches(record: dict[str, Any] | None, size: int) -> RunningBatchMeans:
    """The sums over batches; none yet in files from before they were kept."""
    nothing = running_batch_means.start(size)
    if record is None:
        return nothing
    sums: dict[str, Any] = {
        name: as_array(Array, one) if isinstance(one, list) else convert(one, int)
        for name, one in record.items()
        if name in _KEPT[RunningBatchMeans]
    }
    restored = nothing._replace(**sums)
    if [np.shape(a) for a in restored] != [np.shape(b) for b in nothing]:
        raise LogError("the sums over batches have other shapes")
    return restored
