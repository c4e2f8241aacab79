"""Moments of time, however a program holds them, as seconds since a first one."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from agonic.arrays import Array


def has_moments(values: Any) -> bool:
    """Whether values are moments or intervals of time and no numbers of seconds."""
    if values is None:
        return False
    array = np.asarray(values)
    if array.dtype.kind == "O" and array.ndim == 1 and len(array):
        return hasattr(array[0], "isoformat") or hasattr(array[0], "total_seconds")
    return array.dtype.kind in "mM"


def count_seconds(values: Any, epoch: datetime | None) -> tuple[Array, datetime | None]:
    """Moments (n,) as seconds since `epoch`, or since the whole second of the first, and that.

    Without a zone they are UTC. Intervals are seconds as they are.
    """
    array = np.asarray(values)
    if array.dtype.kind == "O":
        zoned = [getattr(value, "tzinfo", None) is not None for value in array]
        if any(zoned):
            array = np.asarray(
                [np.datetime64(v.astimezone(UTC).replace(tzinfo=None)) for v in array]
            )
        else:
            kind = "datetime64[ns]" if hasattr(array[0], "isoformat") else "timedelta64[ns]"
            array = array.astype(kind)
    if array.dtype.kind == "m":
        return _divide(array), epoch
    there = array[~np.isnat(array)]
    if epoch is None:
        if not len(there):
            return np.full(len(array), np.nan), None
        first = int(there[0].astype("datetime64[s]").astype(np.int64))
        epoch = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=first)
    zero = np.datetime64(epoch.astimezone(UTC).replace(tzinfo=None), "us")
    return _divide(array - zero), epoch


def _divide(intervals: Any) -> Array:
    """Intervals in seconds; what is none is NaN."""
    return np.asarray(intervals / np.timedelta64(1, "s"), dtype=np.float64)
