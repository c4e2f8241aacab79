"""Where a model was trained: a few points that cover the rows, and how far others are from them.

The cover is greedy (Gonzalez 1985): each further centre is the row farthest from all before it, so
no row is farther from a centre than twice what is possible with so many.
"""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array

_ROWS = 16384  # a block whose temporaries stay in the cache


def cover(points: Array, most: int) -> tuple[Array, float]:
    """At most so many centres (k, i) among the points (n, i), and how far a point is from them."""
    first = int(np.argmax(((points - points.mean(axis=0)) ** 2).sum(axis=1)))
    chosen = [first]
    square = ((points - points[first]) ** 2).sum(axis=1)
    while len(chosen) < min(most, len(points)):
        farthest = int(np.argmax(square))
        if square[farthest] == 0.0:
            break
        chosen.append(farthest)
        np.minimum(square, ((points - points[farthest]) ** 2).sum(axis=1), out=square)
    return points[chosen], float(np.sqrt(square.max()))


def compute_distances(points: Array, centres: Array) -> Array:
    """Distance (…) of points (…, i) to the nearest of the centres (k, i)."""
    rows = points.reshape(-1, points.shape[-1])
    own = (centres**2).sum(axis=1)
    nearest = np.empty(len(rows))
    for start in range(0, len(rows), _ROWS):
        some = rows[start : start + _ROWS]
        square = (own - 2.0 * some @ centres.T).min(axis=1) + (some**2).sum(axis=1)
        nearest[start : start + _ROWS] = np.sqrt(np.maximum(square, 0.0))
    return nearest.reshape(points.shape[:-1])


def taper(distance: Array, reach: float) -> Array:
    """1 up to `reach`, 0 from twice that, between them 1 − s²(3 − 2s), s = distance/reach − 1."""
    s = np.clip(distance / reach - 1.0, 0.0, 1.0)
    return np.asarray(1.0 - s**2 * (3.0 - 2.0 * s))


def estimate_neighbour_covariance(
    values: Array, points: Array, neighbours: int = 12
) -> tuple[float, float]:
    """Mean product of values (n, o) with those of the nearest other points (n, i), and its error.

    Noise differs from a point to the next and leaves nothing; what a model missed does not, and
    leaves its mean square. Both are of one component."""
    from scipy.spatial import cKDTree  # slow to load

    k = min(neighbours, len(points) - 1)
    _, nearest = cKDTree(points).query(points, k=k + 1)
    near = values[np.asarray(nearest)[:, 1:]].mean(axis=1)
    error = float(np.mean(values**2)) / np.sqrt(values.size * k / 2)
    return float(np.mean(values * near)), float(error)
