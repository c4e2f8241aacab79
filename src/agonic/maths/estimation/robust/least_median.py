"""Least median of squares: spheres through few readings, a start that outliers cannot reach."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array


def fit_least_median_sphere(
    points: Array,
    magnitude: Array,
    *,
    subsets: int = 300,
    size: int = 6,
    seed: int = 0,
) -> tuple[Array, float]:
    """Bias and gain of the sphere with the least median distance (Rousseeuw 1984).

    Spheres |p|² = 2 c·p + t are put through random subsets of `size` readings; with half the
    readings spoilt a few subsets are still clean. `magnitude` is (1,) or, where the field changes
    from reading to reading, (n,): then |p|² = 2 c·p + t + q F² with gain 1/√q.

    Parameters: points (n, 3) centred and scaled to about one. Returns bias (3,) and gain.
    """
    rng = np.random.default_rng(seed)
    chosen = rng.integers(0, len(points), (subsets, size))
    varies = len(magnitude) > 1 and float(np.ptp(magnitude)) > 0.02 * float(np.mean(magnitude))
    columns = [2 * points, np.ones((len(points), 1))]
    if varies:
        columns.append(magnitude[:, None] ** 2)
    design = np.hstack(columns)
    square = np.einsum("ij,ij->i", points, points)
    rows = design[chosen]
    normal = np.swapaxes(rows, 1, 2) @ rows
    normal += 1e-13 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(design.shape[1])
    right = np.swapaxes(rows, 1, 2) @ square[chosen][..., None]
    solutions = np.linalg.solve(normal, right)[..., 0]
    centres = solutions[:, :3]
    if varies:
        gains = 1 / np.sqrt(np.maximum(solutions[:, 4], 1e-12))
    else:
        radius = np.sqrt(np.maximum(solutions[:, 3] + (centres**2).sum(axis=1), 1e-12))
        gains = float(np.mean(magnitude)) / radius
    judged = rng.permutation(len(points))[:500]
    wanted = (magnitude[judged] if varies else magnitude[:1])[None, :] / gains[:, None]
    distance = -2 * centres @ points[judged].T  # one large array, and all that follows in place
    distance += square[judged]
    distance += (centres**2).sum(axis=1)[:, None]
    np.sqrt(np.maximum(distance, 0.0, out=distance), out=distance)
    distance -= wanted
    np.abs(distance, out=distance)
    middle = round(0.5 * (len(judged) - 1))
    distance.partition(middle, axis=1)  # np.quantile sorts for both ends too
    typical = distance[:, middle]
    typical[~np.isfinite(typical)] = np.inf
    best = int(np.argmin(typical))
    return centres[best], float(gains[best])
