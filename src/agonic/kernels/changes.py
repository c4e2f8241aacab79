"""A bias that moved once: the break that explains the most of the residuals."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Break(NamedTuple):
    """Where the bias moved: row, length of the move, and how much of Σr² the move explains.

    `significance` is the drop of Σr² in units of what is left of it per reading (a χ² with three
    degrees of freedom for white noise).
    """

    row: int
    shift: float
    explained: float
    significance: float


def find_break(residuals: Array, normals: Array, blocks: int = 64) -> Break | None:
    """The best single break in the bias, by linear least squares before and after each edge.

    r_i ≈ n_i · a before and n_i · b after; each side's reduction of Σr² is gᵀG⁻¹g with
    G = Σ n nᵀ and g = Σ n r, summed over blocks of rows (Andrews 1993, sup-LM test).
    residuals (n,), normals (n, 3).
    """
    if len(residuals) < 4 * blocks:
        return None
    edges = np.linspace(0, len(residuals), blocks + 1).astype(int)
    spans = [slice(i, j) for i, j in pairwise(edges)]
    outer = np.array([normals[span].T @ normals[span] for span in spans])
    score = np.array([residuals[span] @ normals[span] for span in spans])
    before_g, before_s = np.cumsum(outer, axis=0)[2:-3], np.cumsum(score, axis=0)[2:-3]
    after_g, after_s = outer.sum(axis=0) - before_g, score.sum(axis=0) - before_s
    ridge = 1e-2 * len(residuals) / blocks * np.eye(3)
    a = np.linalg.solve(before_g + ridge, before_s[..., None])[..., 0]
    b = np.linalg.solve(after_g + ridge, after_s[..., None])[..., 0]
    gain = (a * before_s).sum(axis=1) + (b * after_s).sum(axis=1)
    best = int(np.argmax(gain))
    total = float(residuals @ residuals)
    if total == 0.0:
        return None
    left = max(total - float(gain[best]), 1e-12 * total)
    return Break(
        row=int(edges[best + 3]),
        shift=float(np.linalg.norm(b[best] - a[best])),
        explained=float(gain[best]) / total,
        significance=float(gain[best]) / (left / len(residuals)),
    )
