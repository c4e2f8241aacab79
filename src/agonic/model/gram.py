"""Gram blocks: cross-products of parameters, terms and residuals by blocks of time.

They are all that a fit keeps of its rows: sums of blocks give every estimate, covariance and
evidence, and blocks add over pieces of a log, workers and days.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.model.noise import whiten

BLOCKS = 16
"""Blocks of time: each is predicted from the others, and the bias may step between them."""
ROWS_PER_BLOCK = 3
"""At least, or a block says nothing."""


class Stack(NamedTuple):
    """One channel's rows: `columns` (m + 1, n), of parameters and terms, its residuals last, all
    times the square roots of the rows' weights."""

    name: str
    columns: Array


class Blocks(NamedTuple):
    """Cross-products by channel and block, (c, b, m + 1, m + 1), and rows of each block, (b,)."""

    sums: Array
    rows: Array


def count_blocks(rows: int) -> int:
    """How many blocks so many rows make."""
    return min(BLOCKS, max(rows // ROWS_PER_BLOCK, 1))


def add_up(stacks: list[Stack], filters: list[Array]) -> Blocks:
    """The cross-products of whitened columns."""
    n = stacks[0].columns.shape[1]
    edges = np.linspace(0, n, count_blocks(n) + 1).astype(int)
    sums = []
    for stack, by in zip(stacks, filters, strict=True):
        white = whiten(stack.columns, by)
        parts = [white[:, a:b] for a, b in pairwise(edges)]
        sums.append(np.stack([part @ part.T for part in parts]))
    return Blocks(np.stack(sums), np.diff(edges).astype(float))


def with_steps(blocks: Blocks, radius: float) -> Blocks:
    """The same with a step of the bias before every block but the first, three columns each.

    A step is one after its time and zero before, less its mean over the log: within a block it is a
    multiple of the bias' own columns, so that no row is needed.
    """
    count, m = len(blocks.rows), blocks.sums.shape[-1] - 1
    after = np.arange(count)[:, None] >= np.arange(1, count)  # (b, places)
    heights = radius * (after - blocks.rows @ after / blocks.rows.sum())
    channels, k = len(blocks.sums), 3 * (count - 1)
    across = blocks.sums[:, :, :, None, :3] * heights[:, None, :, None]
    across = across.reshape(channels, count, m + 1, k)
    own = blocks.sums[:, :, None, :3, None, :3] * (
        heights[:, :, None, None, None] * heights[:, None, None, :, None]
    )
    wider = np.empty((channels, count, m + k + 1, m + k + 1))
    first, steps, last = slice(0, m), slice(m, m + k), m + k
    wider[..., first, first] = blocks.sums[..., :m, :m]
    wider[..., first, steps] = across[..., :m, :]
    wider[..., steps, first] = np.swapaxes(across[..., :m, :], -1, -2)
    wider[..., steps, steps] = own.reshape(channels, count, k, k)
    wider[..., last, first] = wider[..., first, last] = blocks.sums[..., :m, m]
    wider[..., last, steps] = wider[..., steps, last] = across[..., m, :]
    wider[..., last, last] = blocks.sums[..., m, m]
    return Blocks(wider, blocks.rows)
