"""Readings that the loss left out: how many, and whether they come together."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.health.evidence import OUTLIERS_DOUBTFUL, SWITCH_PRICE, Evidence
from agonic.health.finding import (
    Fact,
    Finding,
    Limit,
    Told,
    describe_stretches,
    figure,
    find_first,
)
from agonic.maths.equation.coverage import find_cells
from agonic.maths.estimation.changes.hidden_states import find_path
from agonic.maths.one_pass import median

SIGNIFICANT = 1e-3 / 4
"""For each of the four ways to divide the readings."""
BINS = 25
"""Of equal width along the readings of an axis."""
EVENT_ROWS = 5
"""Rows: outliers closer together are one event, as of one jolt."""
MIN_EVENTS = 4
FAR_OVER_SCATTER = 4.0
"""Noises, as they are among the readings that fit and lie there, beyond which a reading is no tail
of the others."""


class Gathered(NamedTuple):
    """Where outliers gather: in words, and the rows (n,) of those that lie there."""

    where: str
    rows: Mask


def find_gathered(e: Evidence) -> Gathered | None:
    """Where outliers come far more often than elsewhere, None where they are as spread as rows. An
    outlier's own reading may be anywhere: the readings before and after it that fit tell where it
    should have been. Of k events among as many rows as could begin one, a region that holds the
    share s of these rows has more by chance with the binomial probability of k and s, which is to
    be less than `SIGNIFICANT` over the number of regions."""
    fits = e.weights > 0
    rows = np.arange(len(fits))  # those since the last outlier: many before the first
    since = rows - np.maximum.accumulate(np.where(fits, -EVENT_ROWS - 1, rows))
    events = ~fits & (np.r_[EVENT_ROWS, since[:-1]] >= EVENT_ROWS)
    if np.count_nonzero(events) < MIN_EVENTS or np.count_nonzero(fits) < 100:
        return None
    should = np.stack([np.interp(rows, rows[fits], axis[fits]) for axis in e.readings.T], axis=1)
    able = events | (fits & (since > EVENT_ROWS))
    found = [*(_divide_axis(should, fits, axis) for axis in range(3))]
    found.append(find_cells((should - e.bias) @ e.shape.T))
    best: tuple[float, int, int] = SIGNIFICANT, -1, -1
    for k, region in enumerate(found):
        p_value, at = _test(region, events & able, able)
        if p_value < best[0] and _stand_out(e, region == at, fits, events):
            best = p_value, k, at
    if best[1] < 0:
        return None
    there = found[best[1]] == best[2]
    return Gathered(_describe(e, should[there & fits], best[1]), there & ~fits)


def _divide_axis(readings: Array, fits: Mask, axis: int) -> Index:
    values = readings[:, axis]
    low, high = values[fits].min(), values[fits].max()
    bins = (values - low) / max(high - low, np.finfo(float).tiny) * BINS
    return np.asarray(np.clip(bins, 0, BINS - 1), dtype=np.intp)


def _test(region: Index, events: Mask, able: Mask) -> tuple[float, int]:
    """The least p-value of all regions, times their number, and the region."""
    from scipy.special import bdtrc  # here, so that what only reads a log loads no SciPy

    size = int(region.max()) + 1
    count = np.bincount(region[events], minlength=size)
    rows = np.bincount(region[able], minlength=size)
    share = (rows + 1.0) / (rows.sum() + size)  # of regions that are hardly visited nothing is sure
    p_values = np.where(count >= MIN_EVENTS, bdtrc(count - 1, count.sum(), share), 1.0)
    at = int(np.argmin(p_values))
    return float(p_values[at]) * int((rows > 0).sum()), at


def _stand_out(e: Evidence, there: Mask, fits: Mask, events: Mask) -> bool:
    """Whether most events of a region are beyond the scatter of the readings there that fit."""
    own = np.abs(e.residuals[there & fits])
    scatter = 1.48 * median(own) if len(own) else 0.0
    return bool(median(np.abs(e.residuals[there & events])) > FAR_OVER_SCATTER * scatter)


def _describe(e: Evidence, readings: Array, way: int) -> str:
    if way < 3:
        low, high = readings[:, way].min(), readings[:, way].max()
        return f"where {'xyz'[way]} reads {figure(low)} to {figure(high)} {e.unit}"
    x, y, z = readings.mean(axis=0)
    return f"where readings are near ({figure(x)}, {figure(y)}, {figure(z)}) {e.unit}"


STRETCH_S = 1.0
STRETCH_SHARE = 0.01
"""A stretch of outliers that lasts as long, or holds that share of the rows, is worth a look."""
_WITHIN = 0.7  # of the readings of a disturbed stretch are outliers
_SHARES = (0.01, 0.3)  # of outliers in the rest, at least and at most


def find_outliers(e: Evidence) -> Finding | None:
    """Readings that the loss left out, with the times or the directions at which they gather."""
    return find_first([IN_STRETCHES, GATHERED, SCATTERED], e)


def _count(e: Evidence) -> dict[str, Any] | None:
    """How many readings were left out, and of how many."""
    count = int(np.count_nonzero(e.weights == 0.0))
    if not count:
        return None
    share = count / len(e.weights)
    move = "look for disturbances at those times" if share > OUTLIERS_DOUBTFUL else ""
    return {"value": share, "count": count, "percent": 100 * share, "move": move}


def _measure_stretches(e: Evidence) -> Told:
    told, outlier = _count(e), e.weights == 0.0
    if told is None or outlier.all():
        return None
    stretches = find_stretches(outlier)
    long = np.array([s for s in stretches if _is_long(s, e.time, len(outlier))])
    if not len(long):
        return None
    apart = np.zeros(len(outlier), dtype=bool)
    for first, last in long:
        apart[first : last + 1] = True
    size = float(np.percentile(np.abs(e.residuals[apart & outlier]), 90))
    return {**told, "times": describe_stretches(long, e.time), "size": size, "unit": e.unit}


def _measure_gathered(e: Evidence) -> Told:
    """Outliers that gather where an axis reads something, or the sensor looks one way, are none."""
    told = _count(e)
    gathered = None if told is None else find_gathered(e)
    if told is None or gathered is None:
        return None
    size, some = median(np.abs(e.residuals[gathered.rows])), int(gathered.rows.sum())
    return {**told, "where": gathered.where, "some": some, "size": size, "unit": e.unit}


LEFT_OUT = "{count} readings ({percent} %) do not fit and were left out"
IN_STRETCHES = Fact(
    "outliers",
    _measure_stretches,
    Limit(OUTLIERS_DOUBTFUL, note=0.0),
    LEFT_OUT + ", most of them {times}, where the magnitude is off by up to {size} {unit}: "
    "something magnetic passed, or a current flowed, and a heading at those times is wrong",
    "{move}",
)
GATHERED = Fact(
    "outliers",
    _measure_gathered,
    "check",
    LEFT_OUT + "; {some} of them gather {where}, where the magnitude is off by {size} {unit}: the "
    "sensor is wrong there, or something magnetic is near in that attitude",
    "a heading from such readings is wrong, whatever the calibration; turn the sensor away from "
    "steel, and check whether it is wrong there again",
)
SCATTERED = Fact("outliers", _count, Limit(OUTLIERS_DOUBTFUL, note=0.0), LEFT_OUT, "{move}")


def find_stretches(outlier: Mask) -> Index:
    """The first and last rows (k, 2) of stretches in which outliers (n,) come together. The
    likeliest path between two shares of outliers, one for the stretches and one for the rest
    (Viterbi 1967)."""
    n = len(outlier)
    start = np.flatnonzero(np.r_[True, outlier[1:] != outlier[:-1]])  # of runs that are alike
    out, length = outlier[start], np.diff(np.r_[start, n])
    inside, rest = np.zeros(len(start), dtype=bool), float(outlier.mean()) / 2
    for _ in range(3):
        share = np.array([np.clip(rest, *_SHARES), _WITHIN])[:, None]
        cost = -np.log(np.where(out, share, 1 - share))
        inside = find_path(cost * length, SWITCH_PRICE) == 1
        if inside.all():
            break
        rest = float(np.average(out[~inside], weights=length[~inside]))
    edges = np.flatnonzero(np.diff(np.r_[False, inside, False].astype(np.int8)))
    return np.append(start, n)[edges].reshape(-1, 2) - [0, 1]


def _is_long(stretch: Index, time: Array | None, n: int) -> bool:
    first, last = stretch
    if last - first + 1 >= STRETCH_SHARE * n:
        return True
    return time is not None and bool(time[last] - time[first] >= STRETCH_S)
