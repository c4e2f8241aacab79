"""Rows that say the same: how much each of them counts, and rows spread over all that was seen."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.one_pass import median

_CELL_SHARE = 1 / 32  # of all that counts, in one cell of many
_FEWEST_CELLS = 12
_FINEST = 21  # so often cubes are halved at most
_TABLE_BITS = 20  # a table of a million cubes is sooner filled than a long list sorted
_THINNED = 0.5  # of the rows; where more are left all stay
_GOLDEN = (1 + 5**0.5) / 2
_ROWS = 1000  # a log that turns shows its orientations in the first of them


def weigh_crowded(cells: Index) -> Array:
    """Weights (n,) of rows in cells (n,), so that no cell counts for much more than the others.

    A cell keeps its rows up to a share of all that counts, 1/32 or twice the mean over the cells.
    A sensor that lay still for most of a log says much of one direction only."""
    counts = np.bincount(cells)
    visited = max(int(np.count_nonzero(counts >= min(3, counts.max(initial=1)))), 1)
    share, cap = max(_CELL_SHARE, 2 / visited), float(counts.max(initial=1))
    for _ in range(60):
        before, cap = cap, min(cap, max(share * float(np.minimum(counts, cap).sum()), 1.0))
        if cap == before:
            break
    return np.asarray(np.minimum(1.0, cap / np.maximum(counts, 1))[cells])


def find_places(points: Array) -> Index:
    """The cube that each of points (n, 3) lies in, numbered; no centre has to be known.

    Cubes are halved until a dozen hold points in succession, so far outliers do not set them; or
    until a dozen hold two beside one in which most points are nothing but noise about one place.
    """
    axes = np.array(points.T, order="C")  # passes along an axis are many times faster so
    axes -= np.array([[median(along)] for along in axes])
    size = 2 * max(float(axes.max(initial=0.0)), -float(axes.min(initial=0.0)))
    cells = np.zeros(len(points), dtype=np.intp)
    apart = np.maximum.reduce(list(np.abs(np.diff(axes, axis=1))))
    least = np.inf
    if len(apart) >= _FEWEST_CELLS:
        least = float(np.partition(apart, _FEWEST_CELLS - 1)[_FEWEST_CELLS - 1])
    for halved in range(2, _FINEST + 1):
        if size == 0.0:
            break
        if size / 2**halved < least and halved < _FINEST:
            continue  # a dozen pairs of successive points are too far apart for one cube each
        cells = _number_cubes(axes, size, halved)
        stays = np.bincount(cells[1:][cells[1:] == cells[:-1]], minlength=cells.max(initial=0) + 1)
        counts = np.bincount(cells)
        if np.count_nonzero((counts >= 3) & (stays > 0)) >= _FEWEST_CELLS:
            break
        if np.count_nonzero(counts >= 2) >= _FEWEST_CELLS and 2 * counts.max() > len(cells):
            fullest = cells == counts.argmax()
            if looks_like_noise(points[fullest]):
                break
    return cells


def looks_like_noise(readings: Array) -> bool:
    """Whether readings (n, 3) jump as far as they range, and pile up in the middle.

    Kurtosis is near 3 for noise, where a turning sensor has 1.8; or they flicker between a few
    levels."""
    sd = np.maximum(readings.std(axis=0), 1e-300)
    jumps = np.diff(readings, axis=0).std(axis=0) / (np.sqrt(2) * sd)
    few_levels = max(len(np.unique(column)) for column in readings.T) < 8
    kurtosis = (((readings - readings.mean(axis=0)) / sd) ** 4).mean()
    return bool(jumps.max() > 0.5 and (few_levels or kurtosis > 2.5))


def _number_cubes(axes: Array, size: float, halved: int) -> Index:
    """The number of the cube of points, by axes (3, n), of a `size` that is halved so many times.

    Numbers of cubes are floors; those that a cast cuts off are none below zero.
    """
    bits = halved + 2
    x, y, z = (
        (along / (size / 2**halved) + (0.5 + 2.0**halved)).astype(np.int64) for along in axes
    )
    key = (x << bits) + y
    if 3 * bits > 62:
        key = np.unique(key, return_inverse=True)[1]
    key = (key << bits) + z
    if 3 * bits > _TABLE_BITS:
        return np.unique(key, return_inverse=True)[1]
    seen = np.zeros(1 << 3 * bits, dtype=bool)
    seen[key] = True
    return np.asarray((np.cumsum(seen) - 1)[key], dtype=np.intp)


def weigh_places(points: Array) -> Array:
    """Weights (n,) of points (n, 3), so that no place counts for much more than the others."""
    return weigh_crowded(find_places(points))


def find_spread_rows(points: Array) -> Index:
    """Rows of points (n, 3), in order, thinned where most of them say the same.

    All rows where none or few would go.
    """
    return choose_spread_rows(weigh_places(points))


def choose_spread_rows(weights: Array, *, most: int | None = None) -> Index:
    """The same from the weights (n,) of the rows, for whoever chooses among them more than once;
    at most `most`, evenly over those that are left.
    """
    rows = np.arange(len(weights))
    if weights.mean() < _THINNED:
        rows = choose_by_weight(weights)
    if most is not None and len(rows) > most:
        rows = rows[choose_evenly(len(rows), most)]
    return rows


def choose_evenly(n: int, most: int) -> Index:
    """So many of n rows, in order, evenly over all of them: the same ones each time."""
    if n <= most:
        return np.arange(n)
    share = most / n
    if share <= 0.5:
        return _pick_evenly(n, share)
    chosen = np.ones(n, dtype=bool)
    chosen[_pick_evenly(n, 1.0 - share)] = False
    return np.flatnonzero(chosen)


def _pick_evenly(n: int, share: float) -> Index:
    """`_pick` of n rows of the same weight: row i reaches (i + 1) share."""
    rows = (_place(round(n * share)) / share).astype(np.intp)
    return np.asarray(rows[rows < n])


def choose_by_weight(weights: Array) -> Index:
    """Of rows with weights (n,) from 0 to 1 so many as they add up to, in order, each as often as
    its weight says: the same ones each time.

    Those of small weight are picked, of the others some are left out."""
    chosen = weights > 0.5
    more, fewer = np.where(chosen, 0.0, weights), np.where(chosen, 1.0 - weights, 0.0)
    chosen[_pick(fewer)] = False
    chosen[_pick(more)] = True
    return np.flatnonzero(chosen)


def _pick(weights: Array) -> Index:
    """One row out of each part of weight one, k from the first by frac((k + 1) φ) of the part: such
    shares fill 0…1 evenly and keep no step with rows that alternate by a pattern. Weights (n,) up
    to a half, so that no row is picked twice: two places are 0.6 apart or more.

    Source: Weyl (1916), with the golden ratio φ; a start of its own in each part (Madow 1949).
    """
    reached = np.cumsum(weights)
    places = _place(round(float(reached[-1])))
    return np.asarray(np.searchsorted(reached, places[places < reached[-1]], side="right"))


def _place(parts: int) -> Array:
    """A place in each of so many parts of length one."""
    part = np.arange(parts)
    return part + (part + 1) * _GOLDEN % 1.0


def count_orientations(points: Array, reach: float, most: int) -> int:
    """How many of points (n, 3) lie further than `reach` from each other, counted up to `most`."""
    known: list[Array] = []
    for start in range(0, len(points), _ROWS):
        left = points[start : start + _ROWS]
        for one in known:
            left = _leave_near(left, one, reach)
        while len(left):
            if len(known) == most:
                return most
            known.append(left[0])
            left = _leave_near(left, left[0], reach)
    return len(known)


def _leave_near(points: Array, one: Array, reach: float) -> Array:
    away = points - one
    return np.asarray(points[np.einsum("ij,ij->i", away, away) > reach**2])
