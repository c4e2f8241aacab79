"""Decimal years, the time that field models are published in."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, date, datetime
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.errors import AgonicError

Moment: TypeAlias = float | str | date | datetime | np.datetime64
Moments: TypeAlias = Moment | Sequence[Moment] | NDArray[np.generic]
"""A moment, or many: decimal years, or anything that names a moment in UTC."""


def decimal_year(time: Moments) -> Array:
    """The decimal year: the year, and the part of that year (365 or 366 days) that has passed."""
    values = np.asarray(time)
    if values.dtype.kind in "fiu":
        return values.astype(np.float64)
    if values.dtype.kind == "M":
        return _of_datetime64(values)
    years = [_of_moment(moment) for moment in np.ravel(values.astype(object))]
    return np.array(years, dtype=np.float64).reshape(values.shape)


def parse_date(text: str) -> datetime:
    """The moment of an ISO 8601 date, UTC where it names no zone."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise AgonicError(f"{text!r} is not a date such as 2026-05-01") from None
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)


def _of_datetime64(moments: NDArray[np.generic]) -> Array:
    if np.isnat(moments).any():
        raise AgonicError("a time is missing (NaT); leave such rows out or give their time")
    moment = moments.astype("datetime64[us]")
    year = moment.astype("datetime64[Y]")
    start = year.astype("datetime64[us]")
    length = (year + np.timedelta64(1, "Y")).astype("datetime64[us]") - start
    return np.asarray(1970.0 + year.astype(np.int64) + (moment - start) / length)


def _of_moment(moment: object) -> float:
    if isinstance(moment, bool) or not isinstance(moment, int | float | str | date | np.generic):
        raise _unreadable(moment)
    if isinstance(moment, str):
        moment = _parse(moment)
    if isinstance(moment, datetime) and moment.tzinfo is not None:
        moment = moment.astimezone(UTC).replace(tzinfo=None)
    if isinstance(moment, date):
        moment = np.datetime64(moment, "us")
    return decimal_year(moment).item() if isinstance(moment, np.datetime64) else float(moment)


def _parse(text: str) -> datetime | float:
    """An ISO 8601 moment, or a decimal year written out."""
    for read in (datetime.fromisoformat, float):
        try:
            return read(text.strip())
        except ValueError:
            continue
    raise _unreadable(text)


def _unreadable(moment: object) -> AgonicError:
    return AgonicError(
        f"{moment!r} is not a time; give a decimal year, a datetime, a date, an ISO 8601 string "
        "or a numpy datetime64, in UTC"
    )
