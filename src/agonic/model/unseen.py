"""Blocks of time left out, by algebra: does the fit to the others foretell them?"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.model.average import Base
from agonic.model.gram import Blocks


class Unseen(NamedTuple):
    """What blocks that a fit has not seen say of it.

    `residuals` is the rms of their residuals over what it should be; `moves_deg` by how much the
    heading moves, rms, as each block is left out, and `expected_deg` by how much it should.
    """

    residuals: float
    moves_deg: float
    expected_deg: float


def predict_unseen(blocks: Blocks, base: Base, level: Array) -> Unseen:
    """Each block by the fit to all others, from M − G_b and its right side.

    Of the residuals e of a block with columns X, by the fit without it, eᵀ(1 + X(M − G_b)⁻¹Xᵀ)⁻¹e =
    eᵀe − (Xᵀe)ᵀM⁻¹(Xᵀe) is as large as the rows are many.

    Parameters: Gram `blocks` over the noise, the `base` that was fitted to all, and `level` (h, m)
    derivatives of the heading.
    """
    columns, m = base.columns, level.shape[1]
    sums = blocks.sums.sum(axis=0)
    whole = np.linalg.inv(base.inverse)
    right = whole @ base.estimate
    squares, moves, spread = list[float](), 0.0, 0.0
    for one in sums:
        own = one[np.ix_(columns, columns)]
        inverse = np.linalg.inv(whole - own)
        without = inverse @ (right - one[columns, -1])
        pull = one[columns, -1] - own @ without
        square = one[-1, -1] - one[columns, -1] @ without - without @ pull
        squares.append(float(square - pull @ base.inverse @ pull))
        apart = level @ (without - base.estimate)[:m]
        moves += float(apart @ apart) / len(level)
        wider = (inverse - base.inverse)[:m, :m]
        spread += float(np.einsum("hi,ij,hj->", level, wider, level)) / len(level)
    ratio = np.array(squares) / (len(blocks.sums) * blocks.rows)
    return Unseen(
        float(np.sqrt(max(float(np.average(ratio, weights=blocks.rows)), 0.0))),
        float(np.sqrt(moves)),
        float(np.sqrt(max(spread, 0.0))),
    )
