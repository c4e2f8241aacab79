"""A start that outliers cannot reach: spheres through few readings, judged by their median."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def least_median_sphere(
    points: Array, magnitude: Array, *, subsets: int = 300, size: int = 6, seed: int = 0
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
    solutions = (np.linalg.pinv(design[chosen]) @ square[chosen][..., None])[..., 0]
    centres = solutions[:, :3]
    if varies:
        gains = 1 / np.sqrt(np.maximum(solutions[:, 4], 1e-12))
    else:
        radius = np.sqrt(np.maximum(solutions[:, 3] + (centres**2).sum(axis=1), 1e-12))
        gains = float(np.mean(magnitude)) / radius
    judged = rng.permutation(len(points))[:500]
    wanted = (magnitude[judged] if varies else magnitude[:1])[None, :] / gains[:, None]
    distance = np.linalg.norm(points[judged][None] - centres[:, None], axis=2) - wanted
    medians = np.median(np.abs(distance), axis=1)
    medians[~np.isfinite(medians)] = np.inf
    best = int(np.argmin(medians))
    return centres[best], float(gains[best])
