"""The track file: JSON that holds a followed calibration exactly, to be resumed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from operator import attrgetter
from pathlib import Path
from typing import Any, get_args, get_type_hints

import msgspec
import numpy as np

from agonic.arrays import Array
from agonic.atomic import write_atomically
from agonic.calibration.affine import Affine
from agonic.calibration.base import Validity
from agonic.calibration.interference import Interference
from agonic.calibration.thermal import Thermal
from agonic.calibration.tracking import Jump, Opening, Recent, TrackerParams, TrackerState
from agonic.errors import AgonicError, LogError
from agonic.logs.contents import read_bytes
from agonic.maths.estimation.filters.kalman import STATES, FilterState
from agonic.maths.estimation.filters.ud_filter import WATCHED
from agonic.maths.estimation.noise import running_batch_means
from agonic.maths.estimation.noise.running_batch_means import RunningBatchMeans
from agonic.maths.estimation.turning import filter as turning
from agonic.maths.estimation.turning import reading
from agonic.maths.rotations.polar import split_rotation
from agonic.provenance import Provenance

SCHEMA = "agonic/track-state@1"

_COMMON = ("unit_in", "gauge", "noise", "sensor", "device_id", "frame_in", "frame_out")
"""What the ground calibration has of the one that was started from, beside its provenance."""
_FIELDS: dict[type, tuple[str, ...]] = {
    Affine: ("bias", "matrix", "covariance", "model", *_COMMON, "parents"),
    Thermal: (
        *("bias", "matrix", "centre_C", "half_range_C", "rate", "covariance", "temperature_C"),
    ),
    Interference: (
        *("bias", "matrix", "covariance", "sources", "coefficients", "typical", "second_sensor"),
    ),
    FilterState: FilterState._fields,
    turning.TurnState: FilterState._fields,
    RunningBatchMeans: RunningBatchMeans._fields,
    **{kind: tuple(one.name for one in fields(kind)) for kind in (Jump, Opening, Recent)},
    TrackerState: tuple(one.name for one in fields(TrackerState) if one.name != "turned"),
}
"""What is written of each part of the state."""
_WRITTEN = {"outliers": "strays", "estimate": "belief"}
"""Names that the file has for others, from its first version."""
_ELSEWHERE = {
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
    record = {
        "schema": SCHEMA,
        "params": asdict(params),
        "state": _record(state),
        "history": history.tolist(),
    }
    return write_atomically(path, msgspec.json.encode(record) + b"\n", updates=True)


def load_track(path: Path | str) -> tuple[TrackerParams, TrackerState, Array]:
    """Settings, state and history of a track file.

    Raises `LogError` where it is missing, damaged, something else, or made by a newer agonic.
    """
    data = read_bytes(path)
    try:
        record = msgspec.json.decode(data, type=dict[str, Any])
        if record["schema"] != SCHEMA:
            raise LogError(f'it needs "schema": "{SCHEMA}" and has {record["schema"]!r}')
        params = msgspec.convert(record["params"], TrackerParams)
        return params, _restore_state(record["state"]), _array(record["history"]).reshape(-1, 7)
    except KeyError as error:
        raise LogError(f"not a usable track file: it lacks {error}", path=path) from None
    except (AgonicError, ValueError, TypeError, RecursionError) as error:
        raise LogError(f"not a usable track file: {error}", path=path) from None


def _record(value: Any) -> Any:
    """A part of the state as JSON holds it."""
    if type(value) in _FIELDS:
        return {
            _WRITTEN.get(name, name): _record(_ELSEWHERE.get(name, attrgetter(name))(value))
            for name in _FIELDS[type(value)]
        }
    if isinstance(value, tuple):
        return [_record(one) for one in value]
    return value.tolist() if isinstance(value, np.ndarray) else value


def _array(value: Any) -> Array:
    return np.array(value, dtype=np.float64)


def _restore_state(record: Mapping[str, Any]) -> TrackerState:
    base = _restore(
        Affine, record["base"], provenance=Provenance(parents=record["base"]["parents"])
    )
    common = {name: getattr(base, name) for name in (*_COMMON, "provenance")}
    ground, aboard = record["ground"], record.get("aboard")
    if ground is not None:
        validity = Validity(temperature_C=msgspec.convert(ground["temperature_C"], _RANGE))
        ground = _restore(Thermal, ground, **common, validity=validity)
    if aboard is not None:
        aboard = _restore(Interference, aboard, **common)
    turned = split_rotation(base.matrix, base.covariance, base.gauge)[1]
    known = {"base": base, "ground": ground, "aboard": aboard, "turned": turned}
    state: TrackerState = _restore(TrackerState, record, **known)
    return state


_RANGE: Any = tuple[float, float] | None


def _restore(kind: Any, record: Mapping[str, Any], **known: Any) -> Any:
    """A part of the state from its record, by the types of its fields; `known` are given."""
    hints = get_type_hints(kind)
    for name in _FIELDS[kind]:
        written = _WRITTEN.get(name, name)
        if name in hints and name not in known and written in record:
            known[name] = _restore_field(hints[name], record[written])
    made = kind(**known)
    if isinstance(made, (Opening, Recent)):
        before = made.prior if isinstance(made, Opening) else made.before
        width = turning.ROW if isinstance(before, turning.TurnState) else 6
        return replace(made, rows=made.rows.reshape(-1, width))
    return made


def _restore_field(hint: Any, value: Any) -> Any:
    for one in (hint, *get_args(hint)):
        if value is not None and one == Array:
            return _array(value)
        if value is not None and one is FilterState:
            return _restore_filter(value)
        if value is not None and one in (Opening, Recent):
            return _restore(one, value)
        if one is Jump:
            return tuple(_restore(Jump, jump) for jump in value)
    return msgspec.convert(value, hint)


def _restore_filter(record: Mapping[str, Any]) -> FilterState:
    turned = len(record["state"]) == turning.STATES["full"]
    watched = reading.WATCHED if turned else WATCHED
    watch = [*record["watch"], *[1.0] * (watched - len(record["watch"]))]  # before `USUAL`
    kind: type[FilterState] = turning.TurnState if turned else FilterState
    size = turning.STATES["full"] if turned else STATES["full"]
    estimate = kind(
        _array(record["state"]),
        _array(record["columns"]),
        _array(record["diagonal"]),
        _array(watch),
        _restore_batches(record.get("batches"), 3 if turned else size),
    )
    m = len(estimate.diagonal)
    shapes = [np.shape(part) for part in estimate[:4]]
    if shapes != [(size,), (m, m), (m,), (watched,)] or m > size:
        raise LogError(f"an estimate has parts of shapes {shapes}")
    return estimate


def _restore_batches(record: Mapping[str, Any] | None, size: int) -> RunningBatchMeans:
    """The sums over batches; none yet in files from before they were kept."""
    nothing = running_batch_means.start(size)
    if record is None:
        return nothing
    restored: RunningBatchMeans = _restore(RunningBatchMeans, record)
    if [np.shape(a) for a in restored] != [np.shape(b) for b in nothing]:
        raise LogError("the sums over batches have other shapes")
    return restored
