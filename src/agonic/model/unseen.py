"""Blocks of time left out, by algebra: does the fit to the others foretell them?"""

from __future__ import annotations

from collections.abc import Iterator
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
    """One block by the fit to all others: how far the unknowns move without it, how much less is
    known of them, and what is left of its squares, as they are and over what they should be."""

    apart: Array
    wider: Array
    square: float
    standard: float


def leave_out(blocks: Array, base: Base) -> Iterator[LeftOut]:
    """Each block by the fit to all others, from M − G_b and its right side.

    Of the residuals e of a block with columns X, by the fit without it, eᵀ(1 + X(M − G_b)⁻¹Xᵀ)⁻¹e =
    eᵀe − (Xᵀe)ᵀM⁻¹(Xᵀe) is as large as the rows are many.

    Parameters: cross-products (b, m + 1, m + 1) over the noise of what the `base` of all holds, the
    residuals last.
    """
    whole = np.linalg.inv(base.inverse)
    right = whole @ base.estimate
    for one in blocks:
        own, score, whole_square = one[:-1, :-1], one[:-1, -1], float(one[-1, -1])
        inverse = np.linalg.inv(whole - own)
        without = inverse @ (right - score)
        pull = score - own @ without
        least = ROUNDING * whole_square
        square = max(float(whole_square - score @ without - without @ pull), least)
        standard = max(square - float(pull @ base.inverse @ pull), least)
        yield LeftOut(without - base.estimate, inverse - base.inverse, square, standard)


def predict_unseen(blocks: Array, counts: Array, base: Base, level: Array) -> Unseen:
    """What each block says of the fit to all others.

    Parameters as in `leave_out`, `counts` (b,) of residuals, `level` (h, m) derivatives of the
    heading.
    """
    m, squares, moves, expected = level.shape[1], list[float](), 0.0, list[float]()
    for one in leave_out(blocks, base):
        squares.append(one.standard)
        moves += float(np.mean((level @ one.apart[:m]) ** 2))
        spread = float(np.einsum("hi,ij,hj->", level, one.wider[:m, :m], level)) / len(level)
        expected.append(max(spread, 0.0))
    ratio = np.array(squares) / counts
    return Unseen(
        float(np.sqrt(max(float(np.average(ratio, weights=counts)), 0.0))),
        float(np.sqrt(moves)),
        float(np.sqrt(sum(expected))),
        sum(expected) ** 2 / max(float(np.square(expected).sum()), 1e-300),
    )
