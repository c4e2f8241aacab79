"""Outliers that gather where an axis reads something, or where the sensor looks one way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.health.evidence import Evidence
from agonic.health.finding import figure
from agonic.maths.equation.coverage import find_cells
from agonic.maths.one_pass import median

SIGNIFICANT = 1e-3 / 4
"""For each of the four ways to divide the readings."""
BINS = 25
"""Of equal width along the readings of an axis."""
APART = 5
"""Rows: outliers closer together are one event, as of one jolt."""
FEWEST = 4
FAR = 4.0
"""Noises, as they are among the readings that fit and lie there, beyond which a reading is no tail
of the others."""


class Gathered(NamedTuple):
    """Where outliers gather: in words, and the rows (n,) of those that lie there."""

    where: str
    rows: Mask


def find_gathered(e: Evidence) -> Gathered | None:
    """Where outliers come far more often than elsewhere, None where they are as spread as rows.

    An outlier's own reading may be anywhere: the readings before and after it that fit tell where
    it should have been. Of k events among as many rows as could begin one, a region that holds the
    share s of these rows has more by chance with the binomial probability of k and s, which is to
    be less than `SIGNIFICANT` over the number of regions.
    """
    fits = e.weights > 0
    since = _count_since(~fits)
    events = ~fits & (np.r_[APART, since[:-1]] >= APART)
    if np.count_nonzero(events) < FEWEST or np.count_nonzero(fits) < 100:
        return None
    should = _interpolate(e.readings, fits)
    able = events | (fits & (since > APART))
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


def _count_since(outlier: Mask) -> Index:
    """Rows since the last outlier, (n,): zero at an outlier, many before the first."""
    rows = np.arange(len(outlier))
    return rows - np.maximum.accumulate(np.where(outlier, rows, -APART - 1))


def _interpolate(readings: Array, fits: Mask) -> Array:
    at, rows = np.flatnonzero(fits), np.arange(len(fits))
    return np.stack([np.interp(rows, at, axis[fits]) for axis in readings.T], axis=1)


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
    p_values = np.where(count >= FEWEST, bdtrc(count - 1, count.sum(), share), 1.0)
    at = int(np.argmin(p_values))
    return float(p_values[at]) * int((rows > 0).sum()), at


def _stand_out(e: Evidence, there: Mask, fits: Mask, events: Mask) -> bool:
    """Whether most events of a region are beyond the scatter of the readings there that fit."""
    own = np.abs(e.residuals[there & fits])
    scatter = 1.48 * median(own) if len(own) else 0.0
    return bool(median(np.abs(e.residuals[there & events])) > FAR * scatter)


def _describe(e: Evidence, readings: Array, way: int) -> str:
    if way < 3:
        low, high = readings[:, way].min(), readings[:, way].max()
        return f"where {'xyz'[way]} reads {figure(low)} to {figure(high)} {e.unit}"
    x, y, z = readings.mean(axis=0)
    return f"where readings are near ({figure(x)}, {figure(y)}, {figure(z)}) {e.unit}"
