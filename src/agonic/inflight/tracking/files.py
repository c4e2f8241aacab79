"""The track file: JSON that holds a followed calibration exactly, to be resumed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from datetime import datetime
from operator import attrgetter
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from msgspec import Struct

from agonic.arrays import Array
from agonic.atomic import write_atomically
from agonic.calibration.affine import Affine
from agonic.calibration.base import Validity
from agonic.calibration.interference import Interference
from agonic.calibration.thermal import Thermal
from agonic.calibration.tracking import Jump, Opening, Recent, TrackerParams, TrackerState
from agonic.errors import AgonicError, LogError
from agonic.logs.contents import read_bytes
from agonic.maths.estimation.filters.jump_test import SCALE, TIME, USUAL, WATCHED
from agonic.maths.estimation.filters.states import TABLES, FilterState
from agonic.maths.estimation.noise import running_batch_means
from agonic.maths.estimation.noise.running_batch_means import RunningBatchMeans
from agonic.maths.rotations.polar import split_rotation
from agonic.provenance import Provenance

Row = tuple[float, ...]
Rows = tuple[Row, ...]


class BaseRecord(Struct, frozen=True, kw_only=True):
    """The calibration that was started from."""

    bias: Row
    matrix: Rows
    covariance: Rows | None
    unit_in: str
    gauge: str
    model: str
    noise: float | None
    sensor: str
    device_id: int | None
    frame_in: str
    frame_out: str
    parents: tuple[str, ...]


class ThermalRecord(Struct, frozen=True, kw_only=True):
    """How the calibration that was started from changes with temperature."""

    bias: Rows
    matrix: tuple[Rows, ...]
    centre_C: float
    half_range_C: float
    rate: Row | None
    covariance: Rows | None
    temperature_C: tuple[float, float] | None


class AboardRecord(Struct, frozen=True, kw_only=True):
    """What the calibration that was started from takes out of what disturbs on board."""

    bias: Row
    matrix: Rows
    covariance: Rows | None
    sources: tuple[str, ...]
    coefficients: Rows
    typical: Row | None
    second_sensor: str | None


class BatchesRecord(Struct, frozen=True):
    """Sums over batches of readings, by which errors that last show; lengths that were reached."""

    score: Row
    pending: Rows
    rows: int
    total: int
    information: Rows
    number: Row
    square: tuple[Rows, ...]
    waiting: Rows


class FilterRecord(Struct, frozen=True):
    """State, factors of its covariance, and what the filter watches."""

    state: Row
    columns: Rows
    diagonal: Row
    watch: Row
    batches: BatchesRecord | None = None


class OpeningRecord(Struct, frozen=True, rename={"outliers": "strays"}):
    """First readings, not yet settled."""

    prior: FilterRecord
    rows: Rows
    before: FilterRecord | None
    outliers: int | None
    learns: bool


class RecentRecord(Struct, frozen=True):
    """The last readings, to go back to the beginning of a jump."""

    before: FilterRecord
    middle: FilterRecord
    rows: Rows


class JumpRecord(Struct, frozen=True):
    """A jump of the bias."""

    time: float
    seen: float
    shift: Row
    shift_sd: Row


class StateRecord(Struct, frozen=True, kw_only=True, rename={"estimate": "belief"}):
    """Where it stands."""

    base: BaseRecord
    ground: ThermalRecord | None
    estimate: FilterRecord
    noise: float
    noise_known: bool
    opening: OpeningRecord | None
    recent: RecentRecord | None
    n: int
    refused: int
    jumps: tuple[JumpRecord, ...]
    epoch: datetime | None
    magnitude: float
    external_sd: float = 0.0
    external_time_s: float = 600.0
    gyro_unused: str = ""
    aboard: AboardRecord | None = None


class TrackFile(Struct, frozen=True):
    """A calibration followed in time, made with agonic."""

    schema: str
    params: dict[str, Any]
    state: StateRecord
    history: Rows


SCHEMA = "agonic/track-state@1"

_NAMES = ("unit_in", "gauge", "noise", "sensor", "device_id", "frame_in", "frame_out", "provenance")


_RECORDS: dict[type, type[Struct]] = {
    Affine: BaseRecord,
    Thermal: ThermalRecord,
    Interference: AboardRecord,
    FilterState: FilterRecord,
    RunningBatchMeans: BatchesRecord,
    Opening: OpeningRecord,
    Recent: RecentRecord,
    Jump: JumpRecord,
}
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
    record = TrackFile(SCHEMA, asdict(params), _record(StateRecord, state), history.tolist())
    return write_atomically(path, msgspec.json.encode(record) + b"\n", updates=True)


def load_track(path: Path | str) -> tuple[TrackerParams, TrackerState, Array]:
    """Settings, state and history of a track file.

    Raises `LogError` where it is missing, damaged, something else, or made by a newer agonic.
    """
    data = read_bytes(path)
    try:
        record = msgspec.json.decode(data, type=TrackFile)
        if record.schema != SCHEMA:
            raise LogError(f'it needs "schema": "{SCHEMA}" and has {record.schema!r}')
        params = msgspec.convert(record.params, TrackerParams)
        return params, _restore_state(record.state), np.array(record.history).reshape(-1, 7)
    except (AgonicError, ValueError, TypeError, RecursionError) as error:
        raise LogError(f"not a usable track file: {error}", path=path) from None


def _record(kind: type[Struct], value: Any) -> Any:
    """A part of the state as its record, by the names that both have."""
    return kind(
        **{
            name: _plain(_ELSEWHERE.get(name, attrgetter(name))(value))
            for name in kind.__struct_fields__
        }
    )


def _plain(value: Any) -> Any:
    """Arrays as lists, and parts of the state as their records."""
    if type(value) in _RECORDS:
        return _record(_RECORDS[type(value)], value)
    if isinstance(value, tuple):
        return tuple(map(_plain, value))
    return value.tolist() if isinstance(value, np.ndarray) else value


def _restore_state(record: StateRecord) -> TrackerState:
    values = msgspec.structs.asdict(record)
    base = _restore_base(record.base)
    parts = {
        "base": base,
        "ground": _restore_ground(record.ground, base),
        "aboard": _restore_aboard(record.aboard, base),
        "estimate": _restore_filter(record.estimate),
        "opening": None if record.opening is None else Opening(**_restore_parts(record.opening)),
        "recent": None if record.recent is None else Recent(**_restore_parts(record.recent)),
        "jumps": tuple(Jump(**_restore_parts(jump)) for jump in record.jumps),
    }
    turned = split_rotation(base.matrix, base.covariance, base.gauge)[1]
    return TrackerState(**values | parts, turned=turned)


def _restore_parts(record: Struct) -> dict[str, Any]:
    """The fields of a record: filters, rows, arrays, and what is plain."""
    values = msgspec.structs.asdict(record)
    for name, value in values.items():
        if isinstance(value, FilterRecord):
            values[name] = _restore_filter(value)
        elif name == "rows":
            filters = (one for one in values.values() if isinstance(one, FilterState))
            values[name] = np.array(value, dtype=np.float64).reshape(-1, next(filters).table.row)
        elif isinstance(value, tuple):
            values[name] = np.array(value)
    return values


def _restore_base(record: BaseRecord) -> Affine:
    values = msgspec.structs.asdict(record)
    parents = values.pop("parents")
    return Affine(**values, provenance=Provenance(parents=parents))


def _restore_ground(record: ThermalRecord | None, base: Affine) -> Thermal | None:
    if record is None:
        return None
    values = msgspec.structs.asdict(record)
    validity = Validity(temperature_C=values.pop("temperature_C"))
    named = {name: getattr(base, name) for name in _NAMES}
    return Thermal(**values, **named, validity=validity)


def _restore_aboard(record: AboardRecord | None, base: Affine) -> Interference | None:
    if record is None:
        return None
    named = {name: getattr(base, name) for name in _NAMES}
    return Interference(**msgspec.structs.asdict(record), **named)


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


def _restore_batches(record: BatchesRecord | None, size: int) -> RunningBatchMeans:
    """The sums over batches; none yet in files from before they were kept."""
    nothing = running_batch_means.start(size)
    if record is None:
        return nothing
    values = msgspec.structs.asdict(record)
    sums: dict[str, Any] = {
        name: np.array(one) if isinstance(one, tuple) else one for name, one in values.items()
    }
    restored = RunningBatchMeans(**sums)
    if [np.shape(a) for a in restored] != [np.shape(b) for b in nothing]:
        raise LogError("the sums over batches have other shapes")
    return restored
