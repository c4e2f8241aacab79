"""Rows that say the same: how much each of them counts, and rows spread over all that was seen."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Index

_CELL_SHARE = 1 / 32  # of all that counts, in one cell of many
_FEWEST_CELLS = 12
_FINEST = 21  # so often cubes are halved at most
_TABLE_BITS = 20  # a table of a million cubes is sooner filled than a long list sorted
_THINNED = 0.5  # of the rows; where more are left all stay
_ROWS = 1000  # a log that turns shows its orientations in the first of them


def weigh_crowded(cells: Index) -> Array:
    """Weights (n,) of rows in cells (n,), so that no cell counts for much more than the others.

    A cell keeps its rows up to a share of all that counts, 1/32 or twice the mean over the cells.
    A sensor that lay still for most of a log says much of one direction only.

    >>> weigh_crowded(np.repeat([0, 1, 2, 3], [91, 3, 3, 3])).round(2)[[0, 99]].tolist()
    [0.1, 1.0]
    """
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

    Cubes are halved until a dozen hold points in succession; so far outliers do not set them.
    """
    middle = np.median(points, axis=0)
    size = 2 * float(np.abs(points - middle).max(initial=0.0))
    cells = np.zeros(len(points), dtype=np.intp)
    apart = np.abs(np.diff(points, axis=0)).max(axis=1, initial=0.0)
    least = np.inf
    if len(apart) >= _FEWEST_CELLS:
        least = float(np.partition(apart, _FEWEST_CELLS - 1)[_FEWEST_CELLS - 1])
    for halved in range(2, _FINEST + 1):
        if size == 0.0:
            break
        if size / 2**halved < least and halved < _FINEST:
            continue  # a dozen pairs of successive points are too far apart for one cube each
        cells = _number_cubes(points - middle, size, halved)
        stays = np.bincount(cells[1:][cells[1:] == cells[:-1]], minlength=cells.max(initial=0) + 1)
        if np.count_nonzero((np.bincount(cells) >= 3) & (stays > 0)) >= _FEWEST_CELLS:
            break
    return cells


def _number_cubes(points: Array, size: float, halved: int) -> Index:
    """The number of the cube of points (n, 3), of a `size` that is halved so many times."""
    bits = halved + 2
    cube = (np.floor(points / (size / 2**halved) + 0.5) + 2.0**halved).astype(np.int64)
    key = (cube[:, 0] << bits) + cube[:, 1]
    if 3 * bits > 62:
        key = np.unique(key, return_inverse=True)[1]
    key = (key << bits) + cube[:, 2]
    if 3 * bits > _TABLE_BITS:
        return np.unique(key, return_inverse=True)[1]
    seen = np.zeros(1 << 3 * bits, dtype=bool)
    seen[key] = True
    return np.asarray((np.cumsum(seen) - 1)[key], dtype=np.intp)


def find_spread_rows(points: Array, *, most: int | None = None, seed: int = 0) -> Index:
    """Rows of points (n, 3), in order, thinned where most of them say the same.

    All rows where none or few would go; at most `most`, drawn.
    """
    n, rng = len(points), np.random.default_rng(seed)
    weights = weigh_crowded(find_places(points))
    rows = np.arange(n)
    if weights.mean() < _THINNED:
        rows = np.flatnonzero(rng.random(n) < weights)
    if most is not None and len(rows) > most:
        rows = np.sort(rng.choice(rows, most, replace=False))
    return rows


def count_orientations(points: Array, reach: float, most: int) -> int:
    """How many of points (n, 3) lie further than `reach` from each other, counted up to `most`.

    >>> poses = np.repeat(np.eye(3), 50, axis=0)
    >>> count_orientations(poses, 0.1, 12)
    3
    """
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
