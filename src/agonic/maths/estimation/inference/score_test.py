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

from agonic.arrays import Array, Mask
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
APART = 1e-12
"""Scores of batches whose squares are no larger a share than this depend on one another."""


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
    be of any size, and what they know less well than that is not tested. `batches` may be others
    than those of the fit.
    """

    columns: Array
    noise: Array | None = None
    shared: Array | None = None
    surely: bool = False
    likely: float = np.inf
    batches: Batches | None = None


class _Projected(NamedTuple):
    """T terms beside the unknowns of a fit, with zeros where one has fewer than K columns.

    Z⊥ᵀWZ⊥ `left` (T, K, K), √ZᵀWZ `size` (T, K), what noise has of `left` (T, K, K), the sum
    `total` (T, K) and the squares `gram` (T, K, K) of the scores of batches. Of each by itself
    A⁻¹JᵀWZ `taken` (p, k), and `scores` (B, k).
    """

    left: Array
    size: Array
    by_noise: Array
    total: Array
    gram: Array
    taken: list[Array]
    scores: list[Array]


def score_tests(
    fit: Linearised, several: Sequence[Terms], at_most: float = 1.0
) -> list[Score | None]:
    """Whether each of several terms belongs into the fit, each by itself.

    They are tested together, but where they are too many for the processor's cache. None for
    those that rows cannot tell, or whose p-value is larger than `at_most`: their size is not asked
    for.
    """
    if not several:
        return []
    width = sum(one.columns.shape[1] for one in several)
    if len(several) > 1 and width * len(fit.residuals) > _TOGETHER:
        return [score_tests(fit, [one], at_most)[0] for one in several]
    projected = _project(fit, several)
    combined, seen = _find_seen(projected, several)
    captured = np.array([one.batches.captured if one.batches else fit.captured for one in several])
    p_values = _hotelling(projected, combined, seen, captured)
    scores: list[Score | None] = []
    for t, one in enumerate(several):
        k = one.columns.shape[1]
        by = combined[t, :k, seen[t]].T
        told = by.size > 0 and p_values[t] <= at_most
        at = (projected.left[t, :k, :k], projected.taken[t], projected.scores[t])
        scores.append(_tell(float(p_values[t]), one, by, *at, captured[t]) if told else None)
    return scores


def _project(fit: Linearised, several: Sequence[Terms]) -> _Projected:
    """What the terms are beyond the unknowns of the fit, and their scores."""
    weighted = np.hstack([one.columns for one in several]) * fit.weights[:, None]
    crossed = fit.jacobian.T @ weighted  # JᵀWZ
    taken = np.asarray(np.linalg.solve(fit.information, crossed), dtype=np.float64)
    held = crossed.T @ taken + taken.T @ fit.prior @ taken
    products = weighted * fit.residuals[:, None]
    ends = np.cumsum([one.columns.shape[1] for one in several]).tolist()
    places = [slice(*edges) for edges in pairwise([0, *ends])]
    for one, at in zip(several, places, strict=True):
        if one.shared is not None:
            products[:, at] -= one.shared * fit.weights[:, None]
    scores = _sum_scores(fit, several, places, products, taken)
    count, most = len(several), max(at.stop - at.start for at in places)
    left, by_noise, gram = (np.zeros((count, most, most)) for _ in range(3))
    size, total = (np.zeros((count, most)) for _ in range(2))
    for t, (one, at) in enumerate(zip(several, places, strict=True)):
        k = at.stop - at.start
        square = one.columns.T @ weighted[:, at]
        left[t, :k, :k] = square - held[at, at]
        size[t, :k] = np.sqrt(square.diagonal())
        if one.noise is not None:
            by_noise[t, :k, :k] = (one.noise.T * fit.weights) @ one.noise
        total[t, :k] = scores[t].sum(axis=0)
        gram[t, :k, :k] = scores[t].T @ scores[t]
    return _Projected(left, size, by_noise, total, gram, [taken[:, at] for at in places], scores)


def _sum_scores(
    fit: Linearised,
    several: Sequence[Terms],
    places: Sequence[slice],
    products: Array,
    taken: Array,
) -> list[Array]:
    """The scores of each of several terms by batches, (B, k); `products` (n, K) are of rows."""
    sums = sums_by(fit.batch, products) - fit.scores @ taken
    return [
        sums[:, at]
        if one.batches is None
        else sums_by(one.batches.of, products[:, at])
        - fit.sum_scores(one.batches.of) @ taken[:, at]
        for one, at in zip(several, places, strict=True)
    ]


def _find_seen(projected: _Projected, several: Sequence[Terms]) -> tuple[Array, Mask]:
    """Combinations (T, K, K) of the columns of each, and which of them (T, K) the fit does not hold
    already and the rows can show at the size that is likely."""
    left, size, by_noise = projected.left, projected.size, projected.by_noise
    scale = 1 / np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(left * (scale[:, :, None] * scale[:, None]))
    combined = scale[:, :, None] * vectors
    held = np.array([HELD if one.surely else 1e-9 for one in several])
    prior = np.array([1 / one.likely for one in several])
    clear = np.array([_clear(one) for one in several])
    noisy = np.sum(combined * (by_noise @ combined), axis=1)
    seen = values > np.maximum(held[:, None], clear[:, None] ** 2 * noisy)
    seen &= values > prior[:, None] ** 2 * np.sum(combined**2, axis=1)
    return combined, seen


def _clear(terms: Terms) -> float:
    return SEEN if terms.shared is None and terms.columns.shape[1] > 1 else SEEN_APART


def _tell(
    p_value: float,
    terms: Terms,
    seen: Array,
    left: Array,
    taken: Array,
    scores: Array,
    captured: float,
) -> Score:
    """The score of terms with this p-value, by combinations (k, m) of columns that are seen."""
    scores = scores @ seen
    gram = seen.T @ left @ seen
    total = scores.sum(axis=0)
    found = np.linalg.solve(gram, total)
    sure = _surely(scores, captured) if terms.surely else 1.0
    root = np.linalg.solve(gram, scores.T) / captured**0.5
    drawn, spread = _draw_in(found, root, seen / terms.likely)
    size = np.asarray(seen @ (drawn * sure))
    unseen = np.eye(len(size)) - seen @ np.linalg.pinv(seen)
    gain = float(total @ found)
    return Score(p_value, size, taken @ size, gain, seen @ spread @ seen.T, unseen)


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


def _hotelling(projected: _Projected, combined: Array, seen: Mask, captured: Array) -> Array:
    """The p-values (T,) that scores of the combinations (T, K, K) of columns that are seen (T, K)
    have mean zero."""
    from scipy.special import fdtrc  # here, so that what only reads a log loads no SciPy

    batches = np.array([len(scores) for scores in projected.scores])
    combined = np.where(seen[:, None], combined, 0.0)
    gram = combined.transpose(0, 2, 1) @ projected.gram @ combined
    length = np.sqrt(np.maximum(np.diagonal(gram, axis1=1, axis2=2), 0.0))
    scale = 1 / np.where(length > 0, length, 1.0)
    values, vectors = np.linalg.eigh(gram * (scale[:, :, None] * scale[:, None]))
    total = scale * (projected.total[:, None] @ combined)[:, 0]
    told = values > APART * values[:, -1:]
    along = (total[:, None] @ vectors)[:, 0]
    statistic = np.sum(np.where(told, along**2, 0.0) / np.where(told, values, 1.0), axis=1)
    statistic = np.minimum(statistic, batches * (1 - 1e-12))
    rank = told.sum(axis=1)
    spare = batches - rank  # what is left to tell chance from
    testable = (batches > seen.sum(axis=1) + 1) & (rank > 0) & (spare > 0)
    rank, free = np.where(testable, rank, 1), np.where(testable, spare, 1)
    ratio = captured * (statistic / rank) / ((batches - statistic) / free)
    return np.where(testable, fdtrc(rank, free, ratio), 1.0)
