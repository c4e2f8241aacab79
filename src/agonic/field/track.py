"""Along a track: the field changes slowly, so a spline between few places gives all the others."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from agonic.arrays import Array, Index

SPACINGS_S = (10.0, 5.0, 2.5, 1.25)
"""Seconds between the nodes of the spline, tried in turn."""
TOLERANCE = 1e-3
"""Largest difference from the model half-way between nodes, nT."""
MANY_ROWS = 10_000
"""Fewer are evaluated sooner than a spline is made."""
ROWS_A_NODE = 16
"""With fewer rows to a node a spline saves nothing."""
SHORTEST = 5
"""Nodes without which a cubic spline is not worth its name."""


def evaluate_along_track(time: Array, exact: Callable[[Index], Array]) -> Array:
    """A smooth vector (3, n) along a track, evaluated exactly at few rows and splined between them.

    Nodes are recorded rows, so no position is interpolated. The spline is compared with the exact
    value at the row in the middle of every two nodes; where it differs by more than `TOLERANCE`
    anywhere, nodes come closer, and at last every row is evaluated. A gap in time ends a spline.

    Parameters: time (n,) s, increasing; exact, the vector (3, k) at the rows (k,) that it is given,
    in axes that do not turn along the track (Earth-fixed).
    """
    if len(time) < MANY_ROWS:  # nor are they looked through for gaps
        return exact(np.arange(len(time)))
    gaps = np.flatnonzero(np.diff(time) > SPACINGS_S[0]) + 1
    vectors = np.empty((3, len(time)))
    left = []
    for rows in np.split(np.arange(len(time)), gaps):
        splined = _spline(time, rows, exact)
        if splined is None:
            left.append(rows)
        else:
            vectors[:, rows] = splined
    if left:
        rest = np.concatenate(left)
        vectors[:, rest] = exact(rest)
    return vectors


def _spline(time: Array, rows: Index, exact: Callable[[Index], Array]) -> Array | None:
    """The vector at rows without a gap, or `None` where a spline is not worth it or not good."""
    if len(rows) < MANY_ROWS:
        return None
    from scipy.interpolate import CubicSpline  # slow to load, and few tracks are long

    for spacing in SPACINGS_S:
        nodes = rows[_nodes(time[rows], spacing)]
        if len(nodes) < SHORTEST or len(rows) < ROWS_A_NODE * len(nodes):
            return None
        middle = (nodes[1:] + nodes[:-1]) // 2
        spline = CubicSpline(time[nodes], exact(nodes), axis=1)
        if np.abs(spline(time[middle]) - exact(middle)).max() < TOLERANCE:
            return np.asarray(spline(time[rows]))
    return None


def _nodes(time: Array, spacing: float) -> Index:
    """The first row at or after each multiple of the spacing, and the last row."""
    ticks = np.arange(time[0], time[-1], spacing)
    return np.unique(np.append(np.searchsorted(time, ticks), len(time) - 1))
