"""Readings as the kernels take them, checked."""

from __future__ import annotations

from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.calibration.tracking import TrackerState
from agonic.errors import AgonicError, UnitError
from agonic.maths.estimation.turning import filter as turning


def make_rows(time: ArrayLike, raw: ArrayLike, magnitude: ArrayLike) -> Array:
    """Rows (n, 6) as the kernel takes them, checked."""
    field = np.atleast_2d(np.asarray(raw, dtype=np.float64))
    rows = np.empty((len(field), 6))
    try:
        rows[:, 0], rows[:, 1:4], rows[:, 4], rows[:, 5] = time, field, magnitude, 1.0
    except ValueError as error:
        raise AgonicError(f"time, raw and magnitude differ in length ({error})") from None
    if not len(rows):
        raise AgonicError("no readings were given")
    if not isfinite(np.add.reduce(rows, axis=None)):  # quicker than to ask each of the numbers
        raise AgonicError("a time, reading or magnitude is not a number; leave such rows out")
    if np.minimum.reduce(rows[:, 4]) <= 0:
        raise UnitError("a reference magnitude must be above zero, in nT")
    return rows


def make_rows_with_rate(
    state: TrackerState,
    time: ArrayLike,
    raw: ArrayLike,
    rate: ArrayLike | None,
    magnitude: ArrayLike,
) -> Array:
    """Rows (n, 9) as the kernel beside a gyro takes them, in the axes of its symmetric matrix."""
    if rate is None:
        raise AgonicError("what is followed beside a gyro needs its rates with every reading")
    known = np.asarray(magnitude, dtype=np.float64)
    plain = make_rows(time, raw, np.where(known == 0, 1.0, known))
    rows = np.empty((len(plain), turning.ROW))
    rows[:, :4], rows[:, 7], rows[:, 8] = plain[:, :4], known, plain[:, 5]
    try:
        rows[:, 4:7] = np.atleast_2d(np.asarray(rate, dtype=np.float64)) @ state.turned.rotation
    except ValueError as error:
        raise AgonicError(f"raw and rate differ in length ({error})") from None
    if not isfinite(rows.sum()):
        raise AgonicError("a rate is not a number; leave such rows out")
    return rows
