"""What goes wrong in real logs, as functions from samples to samples.

Each name makes a `Defect`, so that `clipped(40_000)(samples)` applies one and
`simulate(…, defects=[quantised(10), clipped(40_000)])` several in order. Fields and offsets are
in the unit of the samples, times in their seconds.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Index, Mask
from agonic.errors import AgonicError
from agonic.maths.estimation.noise.autoregression import autoregress
from agonic.samples import Samples
from agonic.simulation.draws import draw_directions

Defect = Callable[[Samples], Samples]
"""A pure function from samples to samples."""

_ROUNDING_S = 1e-6  # differences of times below this are rounding


def quantised(step: float) -> Defect:
    """Readings rounded to multiples of `step`, as a coarse converter gives them."""
    return lambda samples: samples.with_columns(field=np.round(samples.field / step) * step)


def clipped(limit: float) -> Defect:
    """Readings held within ±`limit`, the sensor's range."""
    return lambda samples: samples.with_columns(field=np.clip(samples.field, -limit, limit))


def with_outliers(
    share: float = 0.05, *, smallest: float = 10_000.0, largest: float = 50_000.0, seed: int = 0
) -> Defect:
    """A vector of random direction and of length `smallest`…`largest` added to a share of rows."""

    def defect(samples: Samples) -> Samples:
        rng = np.random.default_rng(seed)
        rows = _some_rows(rng, samples, share)
        field = samples.field.copy()
        lengths = rng.uniform(smallest, largest, len(rows))
        field[rows] += draw_directions(rng, len(rows)) * lengths[:, None]
        return samples.with_columns(field=field)

    return defect


def with_nan(share: float = 0.01, *, seed: int = 0) -> Defect:
    """A share of rows lost to NaN, which the samples reject and count."""

    def defect(samples: Samples) -> Samples:
        rng = np.random.default_rng(seed)
        field = samples.field.copy()
        field[_some_rows(rng, samples, share)] = np.nan
        return samples.with_columns(field=field)

    return defect


def with_gap(start: float, stop: float) -> Defect:
    """No rows from `start` up to, not including, `stop` seconds."""
    return lambda samples: samples.select(~_find_rows_between(samples, start, stop))


def frozen(axis: int, *, start: float = -np.inf) -> Defect:
    """One axis (0, 1, 2) that repeats, from `start` seconds on, its reading of that moment."""
    if axis not in (0, 1, 2):
        raise AgonicError(f"axis is {axis}; it needs 0, 1 or 2 for x, y or z")

    def defect(samples: Samples) -> Samples:
        rows = np.flatnonzero(_find_rows_between(samples, start, np.inf))
        field = samples.field.copy()
        field[rows, axis] = field[rows[:1], axis]
        return samples.with_columns(field=field)

    return defect


def magnet_attached(at: float, offset: ArrayLike, *, until: float = np.inf) -> Defect:
    """A vector `offset` (3,) added from `at` up to `until` seconds."""

    def defect(samples: Samples) -> Samples:
        present = _find_rows_between(samples, at, until)[:, None]
        return samples.with_columns(field=samples.field + present * np.asarray(offset, float))

    return defect


def drifting(offset: ArrayLike) -> Defect:
    """A bias that moves steadily by `offset` (3,) from the first row to the last."""

    def defect(samples: Samples) -> Samples:
        time = _time(samples)
        elapsed = (time - time[0]) / (time[-1] - time[0])
        return samples.with_columns(
            field=samples.field + elapsed[:, None] * np.asarray(offset, float)
        )

    return defect


def with_correlated_noise(sd: float, correlation_s: float, *, seed: int = 0) -> Defect:
    """Gauss–Markov noise on each axis, e(t + Δ) = e(t) exp(−Δ/`correlation_s`) + white noise. `sd`
    is that of one reading; rows are taken to be evenly spaced."""

    def defect(samples: Samples) -> Samples:
        kept = np.exp(-np.median(np.diff(_time(samples))) / correlation_s)
        white = np.random.default_rng(seed).standard_normal((len(samples), 3))
        white[1:] *= np.sqrt(1 - kept**2)  # so that the noise is stationary from the first row
        noise = sd * autoregress(white, kept)
        return samples.with_columns(field=samples.field + noise)

    return defect


def delayed(seconds: float) -> Defect:
    """A field that arrives late beside the other columns: field(t) becomes field(t − `seconds`).
    Rows between two readings are interpolated, those without a reading on both sides left out."""

    def defect(samples: Samples) -> Samples:
        time = _time(samples)
        seen = time - seconds
        late = [np.interp(seen, time, axis) for axis in samples.field.T]
        arrived = (seen > time[0] - _ROUNDING_S) & (seen < time[-1] + _ROUNDING_S)
        return samples.with_columns(field=np.stack(late, axis=1)).select(arrived)

    return defect


def duplicated(times: int = 2) -> Defect:
    """Each reading held for `times` rows, as when a log is written faster than the sensor reads."""

    def defect(samples: Samples) -> Samples:
        rows = np.arange(len(samples))
        return samples.with_columns(field=samples.field[rows - rows % times])

    return defect


def mixed(other: Samples) -> Defect:
    """The rows of two sensors in turn under one name, in the columns that both have. Rows of
    `other` come half an interval after their partners where the times are the same."""

    def defect(samples: Samples) -> Samples:
        time, second = _time(samples), _time(other)
        if np.isin(second, time).any():
            second = second + np.median(np.diff(time)) / 2
        order = np.argsort(np.concatenate([time, second]), kind="stable")
        right = other.with_columns(time=second).columns()
        joined = {
            name: np.concatenate([left, right[name]])[order] if name in right else None
            for name, left in samples.columns().items()
        }
        return samples.with_columns(**joined)

    return defect


def _some_rows(rng: np.random.Generator, samples: Samples, share: float) -> Index:
    """A share of the row numbers, each at most once."""
    if not 0 <= share <= 1:
        raise AgonicError(f"share is {share}; it needs a number from 0 to 1")
    return rng.choice(len(samples), size=round(share * len(samples)), replace=False)


def _time(samples: Samples) -> Array:
    if samples.time is None:
        raise AgonicError("this defect happens at a time and the samples have none; give them one")
    return samples.time


def _find_rows_between(samples: Samples, start: float, stop: float) -> Mask:
    """The rows from `start` up to, not including, `stop` seconds."""
    if start == -np.inf and stop == np.inf:
        return np.ones(len(samples), dtype=bool)
    time = _time(samples)
    return np.asarray((time >= start) & (time < stop))


DECIMALS = {
    "time": 6,
    "field": 3,
    "second": 3,
    "scalar": 3,
    "acceleration": 5,
    "rotation_rate": 6,
    "roll_deg": 4,
    "pitch_deg": 4,
    "heading_deg": 4,
    "temperature": 3,
    "latitude_deg": 7,
    "longitude_deg": 7,
    "altitude_m": 3,
}
"""Digits behind the point of a column; six elsewhere. All are far below what sensors resolve."""


def round_as_logged(samples: Samples) -> Samples:
    """The samples with each column to a thousandth of what its sensors resolve."""
    return samples.with_columns(
        **{
            name: np.round(values, DECIMALS.get(name, 6))
            for name, values in samples.columns().items()
        }
    )
