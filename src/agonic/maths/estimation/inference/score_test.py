"""Rao's score test: would a fit be better with terms that it does not have, and by how much.

Nothing is fitted again. With residuals r (scaled to unit noise), their Jacobian J, weights W,
information A = JᵀWJ + P and the columns Z of the terms that are missing (they leave r − Z γ),

    Z⊥ = Z − J A⁻¹ JᵀW Z,   g = Z⊥ᵀW r,   γ = (Z⊥ᵀW Z⊥)⁻¹ g,   δθ = A⁻¹ JᵀW Z γ

are what the terms explain beyond the fit, their score, their size by one Gauss–Newton step, and how
far the estimate moves with them. The covariance of g is that of its sums over batches of rows, so
that noise with memory, unequal or non-Gaussian, does not raise a false alarm: T = gᵀS⁻¹g with
S = Σ g_b g_bᵀ over B batches is Hotelling's statistic, (T/k)/((B − T)/(B − k)) follows F(k, B − k).

Source: C. R. Rao (1948), Math. Proc. Cambridge Phil. Soc. 44, 50; W. Newey, K. West (1987),
Econometrica 55, 703, for scores with memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.maths.estimation.inference.linearised import Batches, Linearised, sums_by

SEEN = 4.0
"""A combination of columns must stand out of its own noise by this factor to be tested."""
SEEN_APART = 2.0
"""The same where what columns and residuals share is taken out of the score, and for one column
alone, which was not picked among many."""

HELD = 1e-4
"""A combination of columns of which no larger share is beyond the fit's unknowns may be left out:
after a long rest a drift looks like a bias and gains."""
_TOGETHER = 200_000  # numbers of columns that are projected at once
SURE = 3.0
"""Standard errors by which a combination may have to be seen to have a size."""


class Score(NamedTuple):
    """One test: its p-value, the size (k,) of the terms, and how far they move the estimate (p,).

    `gain` is by how much the terms lower the weighted sum of squares, `spread` (k, k) the
    covariance of the size, `unseen` (k, k) the projection onto combinations that rows do not show.
    """

    p_value: float
    size: Array
    move: Array
    gain: float
    spread: Array
    unseen: Array


class Terms(NamedTuple):
    """What may be missing in a fit: its `columns` (n, k).

    `noise` (n, k) is a draw of what noise in the readings does to the columns: combinations that
    hardly stand out of it are left out, for there the noise of columns and residuals is the same,
    and they would seem to agree. `shared` (n, k) is their covariance with the residuals by noise
    that is in both: it is taken out of the score. `surely` leaves out what is hardly beyond the
    fit's unknowns, and of the size what does not stand out of chance. `likely` is the prior
    standard deviation of the size: what rows hardly tell from the unknowns of the fit would else
    be of any size, and what they know less well than that is not tested.
    """

    columns: Array
    noise: Array | None = None
    shared: Array | None = None
    surely: bool = False
    likely: float = np.inf


def score_tests(
    fit: Linearised,
    several: Sequence[Terms],
    at_most: float = 1.0,
    batches: Batches | None = None,
) -> list[Score | None]:
    """Whether each of several terms belongs into the fit, each by itself.

    They are projected together, but where they are too many for the processor's cache. None for
    those that rows cannot tell, or whose p-value is larger than `at_most`: their size is not asked
    for. `batches` other than
    those of the fit may be given.
    """
    if not several:
        return []
    width = sum(one.columns.shape[1] for one in several)
    if len(several) > 1 and width * len(fit.residuals) > _TOGETHER:
        return [score_tests(fit, [one], at_most, batches)[0] for one in several]
    within = batches or Batches(fit.batch, fit.captured)
    weighted = np.hstack([one.columns for one in several]) * fit.weights[:, None]
    crossed = fit.jacobian.T @ weighted  # JᵀWZ
    taken = np.asarray(np.linalg.solve(fit.information, crossed), dtype=np.float64)
    products = weighted * fit.residuals[:, None]
    ends = np.cumsum([one.columns.shape[1] for one in several]).tolist()
    places = [slice(*edges) for edges in pairwise([0, *ends])]
    for one, at in zip(several, places, strict=True):
        if one.shared is not None:
            products[:, at] -= one.shared * fit.weights[:, None]
    own = fit.scores if batches is None else fit.sum_scores(batches.of)
    scores = sums_by(within.of, products) - own @ taken
    limits = (at_most, within.captured)
    return [
        _test(fit, one, weighted[:, at], crossed[:, at], taken[:, at], scores[:, at], limits)
        for one, at in zip(several, places, strict=True)
    ]


def _test(
    fit: Linearised,
    terms: Terms,
    weighted: Array,
    crossed: Array,
    taken: Array,
    scores: Array,
    limits: tuple[float, float],
) -> Score | None:
    """The test of terms from WZ, JᵀWZ, A⁻¹JᵀWZ and the scores of batches (B, k).

    `limits`: the p-value up to which a size is asked for, and what batches show of the variance.
    """
    at_most, captured = limits
    columns, noise, shared, surely, likely = terms
    square = columns.T @ weighted
    left = square - crossed.T @ taken - taken.T @ fit.prior @ taken  # Z⊥ᵀWZ⊥
    by_noise = None if noise is None else (noise.T * fit.weights) @ noise
    clear = SEEN if shared is None and columns.shape[1] > 1 else SEEN_APART
    size = np.sqrt(np.diag(square))
    seen = _find_seen(left, size, by_noise, clear, HELD if surely else 1e-9, likely)
    if seen is None:
        return None
    scores = scores @ seen
    p_value = _hotelling(scores, captured)
    if p_value > at_most:
        return None
    gram = seen.T @ left @ seen
    total = scores.sum(axis=0)
    found = np.linalg.solve(gram, total)
    sure = _surely(scores, captured) if surely else 1.0
    root = np.linalg.solve(gram, scores.T) / captured**0.5
    drawn, spread = _draw_in(found, root, seen / likely)
    size = np.asarray(seen @ (drawn * sure))
    unseen = np.eye(len(size)) - seen @ np.linalg.pinv(seen)
    gain = float(total @ found)
    return Score(p_value, size, taken @ size, gain, seen @ spread @ seen.T, unseen)


def _find_seen(
    left: Array, size: Array, by_noise: Array | None, clear: float, held: float, likely: float
) -> Array | None:
    """Combinations (k, m) of columns that the fit does not hold already and the rows can show at
    the size that is likely.

    Parameters: Z⊥ᵀWZ⊥ (k, k), the size √ZᵀWZ of columns (k,), and what their
    noise has of it (k, k).
    """
    scale = 1 / np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(left * np.outer(scale, scale))
    combined = scale[:, None] * vectors
    keep = (values > held) & (values * likely**2 > (combined**2).sum(axis=0))
    if by_noise is not None:
        keep &= values > clear**2 * np.sum(combined * (by_noise @ combined), axis=0)
    return combined[:, keep] if keep.any() else None


def _draw_in(found: Array, root: Array, prior: Array) -> tuple[Array, Array]:
    """A size (r,) with a prior, and its covariance: (1 + V PᵀP)⁻¹ of both, V that of its errors by
    its root (r, B) and P the rows (k, r) of the prior."""
    own = root @ root.T
    drawn = np.linalg.inv(np.eye(len(found)) + own @ prior.T @ prior)
    return np.asarray(drawn @ found), np.asarray(drawn @ own)


def _surely(scores: Array, captured: float) -> Array:
    """Which scores of batches (B, k) stand out: 1, or 0 for what would be large by chance alone."""
    chance = (scores**2).sum(axis=0) / captured
    return np.asarray(scores.sum(axis=0) ** 2 > SURE**2 * chance, dtype=np.float64)


def _hotelling(scores: Array, captured: float) -> float:
    """The p-value that the scores of batches (B, k) have mean zero."""
    from scipy.special import fdtrc  # here, so that what only reads a log loads no SciPy

    batches, k = scores.shape
    if batches <= k + 1:
        return 1.0
    length = np.sqrt((scores**2).sum(axis=0))
    left, values, _ = np.linalg.svd(scores / np.where(length > 0, length, 1.0), full_matrices=False)
    rank = int(np.count_nonzero(values > 1e-7 * values[0]))
    if rank in (0, batches):  # nothing is left to tell chance from
        return 1.0
    statistic = min(float(((left[:, :rank].sum(axis=0)) ** 2).sum()), batches * (1 - 1e-12))
    ratio = captured * (statistic / rank) / ((batches - statistic) / (batches - rank))
    return float(fdtrc(rank, batches - rank, ratio))
