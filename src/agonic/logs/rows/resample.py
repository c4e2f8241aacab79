"""Columns recorded at other times than the magnetometer, brought onto its rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Mask
from agonic.maths.one_pass import interpolate

ESTIMATED_ATTITUDE = (
    "roll, pitch and heading are the autopilot's own estimate, which itself follows its compasses"
)

LONGEST_LOG_S = 1e10
"""Three centuries: a time farther than this from the others is damaged."""


def resample(
    time_from: ArrayLike, values: ArrayLike, time_to: ArrayLike, *, period: float | None = None
) -> Array | None:
    """Values at other times, by linear interpolation; before and after, the end values hold.

    Rows with a time or value that is not finite are left out. Angles, marked by their `period`,
    go the short way round and keep the range they came in: 0…period where no value is negative,
    ±period/2 otherwise.

    Parameters: time_from (n,), values (n,) or (n, 3), time_to (m,), in one unit of time; period
    in the unit of the values. Returns (m,) or (m, 3), or `None` where no usable row is left.
    """
    t, v, wanted = (np.asarray(a, dtype=np.float64) for a in (time_from, values, time_to))
    usable = np.isfinite(t) & np.isfinite(v).reshape(len(v), -1).all(axis=1)
    if not usable.any():
        return None
    order = np.flatnonzero(usable)[np.argsort(t[usable], kind="stable")]
    t, v = t[order], v[order]
    if period is not None:
        lowest = 0.0 if (v >= 0).all() else -period / 2
        turned = np.interp(wanted, t, np.unwrap(v, period=period))
        return np.asarray(lowest + (turned - lowest) % period)
    return interpolate(wanted, t, v)


def interpolate_smoothly(wanted: Array, time: Array, values: Array) -> Array:
    """Values (n,) at wanted times (m,) within their own (n,), by cubics that meet with one slope.
    Between readings of a field that bends, lines are off by F'' Δt²/8 to one side, which a fit
    takes for an offset; here an error is of the third order, and noise spreads two readings far.
    Source: Catmull & Rom, "A class of local interpolating splines", 1974."""
    from scipy.interpolate import CubicHermiteSpline  # slow to load

    if len(time) < 3:
        return interpolate(wanted, time, values)
    return np.asarray(CubicHermiteSpline(time, values, np.gradient(values, time))(wanted))


def find_misplaced(time: ArrayLike) -> Mask:
    """Rows whose time lies outside that of both neighbours although those are in order. Of the
    first row: later than the two after it, which are in order. Farther than `LONGEST_LOG_S` from
    the median is misplaced anywhere. One damaged time would otherwise cost every row after it,
    since times must increase."""
    t = np.asarray(time, dtype=np.float64)
    known = t[np.isfinite(t)]
    if not len(known):
        return np.zeros(len(t), dtype=bool)
    with np.errstate(over="ignore", invalid="ignore"):
        wrong = np.abs(t - np.median(known)) > LONGEST_LOG_S
    before, here, after = t[:-2], t[1:-1], t[2:]
    wrong[1:-1] |= (before <= after) & ((here < before) | (here > after))
    wrong[:1] |= t[:1] > t[2:3] if len(t) > 2 and t[1] < t[2] else False
    return wrong
