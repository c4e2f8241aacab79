"""Vectors and rotations: cross products as matrices, best rotation (Wahba), smallest rotation."""

from __future__ import annotations

import numpy as np

from agonic.arrays import Array


def skew(vector: Array) -> Array:
    """The skew-symmetric matrix [v]× with [v]× w = v × w, (…, 3, 3) of vectors (…, 3)."""
    x, y, z = np.moveaxis(np.asarray(vector, dtype=np.float64), -1, 0)
    matrix = np.zeros((*x.shape, 3, 3))
    matrix[..., 2, 1], matrix[..., 0, 2], matrix[..., 1, 0] = x, y, z
    return matrix - np.swapaxes(matrix, -1, -2)


def find_best_rotation(start: Array, end: Array, weights: Array | None = None) -> Array:
    """The rotation R (…, 3, 3), active, with R start ≈ end in the least-squares sense.

    Wahba's problem, solved by singular values (the Kabsch algorithm). Parameters: start, end
    (…, n, 3) vectors before and after; weights (n,) of the pairs, 1 without.

    Source: Kabsch, Acta Crystallographica A32, 1976; Markley, Journal of the Astronautical
    Sciences 36, 1988."""
    weighted = end if weights is None else end * weights[:, None]
    u, _, vt = np.linalg.svd(np.swapaxes(weighted, -1, -2) @ start)
    u[..., 2] *= np.sign(np.linalg.det(u) * np.linalg.det(vt))[..., None]
    return np.asarray(u @ vt)


def find_smallest_rotation(start: Array, end: Array) -> Array:
    """The smallest rotation (…, 3, 3), active, that turns unit vectors start (…, 3) into end.

    1 + [w]× + [w]×²/(1 + a·b) with w = a × b; not determined for opposite vectors."""
    across = skew(np.cross(start, end))
    along = np.maximum((start * end).sum(axis=-1), -1 + 1e-9)[..., None, None]
    return np.asarray(np.eye(3) + across + across @ across / (1.0 + along))
