"""An ellipse through points of a plane, where a fit starts, and what was seen of the circle."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array, Index

SECTORS = 24
"""Of the circle, 15° each."""
FEW = 5 * SECTORS
"""Readings of which chance leaves some sectors empty."""


def find_sectors(field: Array) -> Index:
    """Readings in each of the sectors of the circle, (24,), by the direction of the field (n, 2).

    Few readings leave sectors empty by chance: they have sectors twice as wide, (12,).
    """
    angle = np.arctan2(field[:, 1], field[:, 0]) % (2 * np.pi)
    many = SECTORS if len(field) >= FEW else SECTORS // 2
    sector = (angle * many / (2 * np.pi)).astype(int) % many
    return np.bincount(sector, minlength=many)


def compute_turns(field: Array) -> tuple[float, float]:
    """How many turns were made to the right and to the left, by the field (n, 2) in time order."""
    heading = np.unwrap(np.arctan2(-field[:, 1], field[:, 0]))
    steps = np.diff(heading[:: max(len(heading) // 200, 1)]) / (2 * np.pi)
    return float(steps[steps > 0].sum()), float(-steps[steps < 0].sum())


TRIALS = 60
"""Small sets of points that are tried, so that one without outliers is among them."""
_DRAWN = 8
_MOST_READINGS = 3000
_LONGEST = 20.0
"""Over the other axis: a longer ellipse is a line."""


def find_start(points: Array, seed: int = 0) -> Array:
    """Bias x y z and matrix xx yy xy of the ellipse that most points (n, 2) are near, (6,).

    Of the conic through all points, those through small sets of them, and a circle: the one whose
    median distance is the smallest, which outliers do not reach.
    """
    rng = np.random.default_rng(seed)
    some = points
    if len(points) > _MOST_READINGS:
        some = points[rng.choice(len(points), _MOST_READINGS, replace=False)]
    sets = [some, *(some[rng.choice(len(some), _DRAWN)] for _ in range(TRIALS))]
    found = [one for one in map(fit_conic, sets) if one is not None] + [fit_circle(some)]
    best = min(found, key=lambda one: float(np.median(np.abs(compute_distances(some, one)))))
    return np.insert(best, 2, 0.0)


def fit_conic(points: Array) -> Array | None:
    """The ellipse a x² + b xy + c y² + d x + e y + f = 0 of least squares; None where none is."""
    x, y = points.T
    design = np.stack([x * x, x * y, y * y, x, y, np.ones(len(x))], axis=1)
    a, b, c, d, e, f = np.linalg.eigh(design.T @ design)[1][:, 0]
    m = np.array([[a, b / 2], [b / 2, c]])
    if np.linalg.det(m) <= 1e-12:
        return None
    bias = np.linalg.solve(m, [-d / 2, -e / 2])
    values, axes = np.linalg.eigh(m / (bias @ m @ bias - f))
    if not values[0] > 0 or values[1] > _LONGEST**2 * values[0]:
        return None
    w = axes @ np.diag(np.sqrt(values)) @ axes.T
    return np.array([*bias, w[0, 0], w[1, 1], w[0, 1]])


def fit_circle(points: Array) -> Array:
    """The circle x² + y² = 2 a x + 2 b y + c of least squares, as an ellipse."""
    design = np.column_stack([2 * points, np.ones(len(points))])
    a, b, c = np.linalg.lstsq(design, (points**2).sum(axis=1), rcond=None)[0]
    gain = 1 / np.sqrt(max(c + a * a + b * b, 1e-12))
    return np.array([a, b, gain, gain, 0.0])


def compute_distances(points: Array, ellipse: Array) -> Array:
    """How far points (n, 2) are from an ellipse, to first order, (n,)."""
    bias, matrix = ellipse[:2], make_matrix(ellipse)
    u = (points - bias) @ matrix
    size = np.maximum(np.linalg.norm(u, axis=1), 1e-300)
    return np.asarray((size - 1) / np.linalg.norm(u / size[:, None] @ matrix, axis=1))


def make_matrix(ellipse: Array) -> Array:
    """The matrix (2, 2) of bias x y and matrix xx yy xy."""
    return np.array([[ellipse[2], ellipse[4]], [ellipse[4], ellipse[3]]])
