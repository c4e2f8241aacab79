"""Blocks of time left out, by algebra: does the fit to the others foretell them?"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.model.average import ROUNDING, Base


class Unseen(NamedTuple):
    """What blocks that a fit has not seen say of it.

    `residuals` is the rms of their residuals over what it should be; `moves_deg` by how much the
    heading moves, rms, as each block is left out, `expected_deg` by how much it should, and
    `independent` how many blocks of equal weight that is: one, where one holds all turns.
    """

    residuals: float
    moves_deg: float
    expected_deg: float
    independent: float


class LeftOut(NamedTuple):
    """Each block by the fit to all others: the information (b, m, m) and the unknowns (b, m) of
    that, and what is left of the block's squares, as they are and over what they should be, (b,).
    """

    information: Array
    unknowns: Array
    square: Array
    standard: Array


def leave_out(blocks: Array, base: Base) -> LeftOut:
    """Each block by the fit to all others, from M − G_b and its right side.

    Of the residuals e of a block with columns X, by the fit without it, eᵀ(1 + X(M − G_b)⁻¹Xᵀ)⁻¹e =
    eᵀe − (Xᵀe)ᵀM⁻¹(Xᵀe) is as large as the rows are many.

    Parameters: cross-products (b, m + 1, m + 1) over the noise of what the `base` of all holds, the
    residuals last.
    """
    whole = np.asarray(np.linalg.inv(base.inverse), dtype=np.float64)
    own, score, squares = blocks[:, :-1, :-1], blocks[:, :-1, -1], blocks[:, -1, -1]
    others, right = whole - own, whole @ base.estimate - score
    unknowns = np.asarray(np.linalg.solve(others, right[:, :, None])[:, :, 0])
    pull = score - (own @ unknowns[:, :, None])[:, :, 0]
    least = ROUNDING * squares
    square = np.maximum(squares - np.sum((score + pull) * unknowns, axis=1), least)
    standard = np.maximum(square - np.sum((pull @ base.inverse) * pull, axis=1), least)
    return LeftOut(others, unknowns, square, standard)


def predict_unseen(blocks: Array, counts: Array, base: Base, level: Array) -> Unseen:
    """What each block says of the fit to all others.

    Parameters as in `leave_out`, `counts` (b,) of residuals, `level` (h, m) derivatives of the
    heading.
    """
    m, left = level.shape[1], leave_out(blocks, base)
    moves = np.mean(((left.unknowns - base.estimate)[:, :m] @ level.T) ** 2, axis=1)
    wider = np.linalg.inv(left.information) - base.inverse
    spread = np.sum(wider[:, :m, :m] * (level.T @ level / len(level)), axis=(1, 2))
    expected = np.maximum(spread, 0.0)
    return Unseen(
        float(np.sqrt(left.standard.sum() / counts.sum())),
        float(np.sqrt(moves.sum())),
        float(np.sqrt(expected.sum())),
        float(expected.sum() ** 2 / max(expected @ expected, 1e-300)),
    )
