"""The file that holds where a live calibration stands, float for float, to go on from there."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any
from zlib import crc32

import msgspec
import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from agonic.atomic import write_atomically
from agonic.errors import AgonicError, LogError
from agonic.live.quarantine import find_plausible
from agonic.live.state import LiveParams, LiveState
from agonic.live.track import ROW_COLUMNS
from agonic.logs.contents import read_bytes

SCHEMA = "agonic/live-state@1"


class ArrayRecord(Struct, frozen=True):
    """An array: its shape, and its numbers as little-endian bytes, `f8` or `i8`."""

    shape: tuple[int, ...]
    kind: str
    data: bytes


class StateFile(Struct, frozen=True):
    """Where a live calibration stands, made with agonic; `origin` is where readings came from.
    `check` is the CRC-32 of the file with a zero in its place, 0 where there is none."""

    schema: str
    origin: str
    params: dict[str, Any]
    state: dict[str, Any]
    check: int = 0


def save_state(params: LiveParams, state: LiveState, path: Path | str, origin: str = "") -> Path:
    """Write the state in one step; `AgonicError` where the file cannot be written."""
    record = StateFile(SCHEMA, origin, asdict(params), vars(state))
    record = replace(record, check=_compute_check(record))
    return write_atomically(path, msgspec.msgpack.encode(record, enc_hook=_encode), updates=True)


def load_state(path: Path | str) -> tuple[LiveParams, LiveState, str]:
    """Settings, state and origin of a state file."""
    data = read_bytes(path)
    try:
        record = msgspec.msgpack.decode(data, type=StateFile)
        if record.schema != SCHEMA:
            raise LogError(f'it needs "schema": "{SCHEMA}" and has {record.schema!r}')
        if record.check and record.check != _compute_check(record):
            raise LogError("it is damaged")
        params = msgspec.convert(record.params, LiveParams)
        state = msgspec.convert(record.state, LiveState, dec_hook=_decode)
        _check(params, state)
    except (AgonicError, msgspec.MsgspecError, ValueError, TypeError, RecursionError) as error:
        raise LogError(f"not a usable state of a live calibration: {error}", path=path) from None
    return params, state, record.origin


def _compute_check(record: StateFile) -> int:
    """The checksum of a record, never 0."""
    return crc32(msgspec.msgpack.encode(replace(record, check=0), enc_hook=_encode)) or 1


def _check(params: LiveParams, state: LiveState) -> None:
    """`LogError` where a state has tables of other shapes, or readings that no sensor gives."""
    for name, columns in {"kept": 4, "recent": 4, "waiting": 4}.items():
        table = getattr(state, name)
        if table.ndim != 2 or table.shape[1] != columns:
            raise LogError(f"its {name} is no table of {columns} columns")
        if not (np.isfinite(table[:, 0]) & find_plausible(table[:, 1:], params.unit)).all():
            raise LogError(f"its {name} holds readings that no sensor gives")
    track = state.track
    if track is not None:
        whole = track.sums.shape == (len(track.slots), ROW_COLUMNS) and track.width > 0
        if not (whole and np.isfinite(track.sums[:, :8]).all() and (track.sums[:, 0] > 0).all()):
            raise LogError("its track is damaged")
    boxes = state.voxels
    if boxes is not None:
        count = len(boxes.keys)
        whole = boxes.sums.shape == (count, 35) and boxes.keys.shape == (count, 3)
        if not (whole and np.isfinite(boxes.sums).all() and (boxes.counts > 0).all()):
            raise LogError("its boxes are damaged")


def _encode(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        kind = "i8" if value.dtype.kind == "i" else "f8"
        return ArrayRecord(value.shape, kind, value.astype("<" + kind).tobytes())
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} is not kept in a state")


def _decode(kind: type, value: Any) -> Any:
    record = msgspec.convert(value, ArrayRecord)
    if record.kind not in ("f8", "i8"):
        raise ValueError(f"numbers of kind {record.kind!r}")
    return np.frombuffer(record.data, "<" + record.kind).reshape(record.shape).copy()
