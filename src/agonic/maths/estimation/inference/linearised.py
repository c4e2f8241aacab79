"""`Linearised`: a fit at its solution, what further terms leave of it, and batches of its rows.

Sums of residuals over batches of rows show how much noise with memory really scatters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.maths.estimation.noise.residuals import correlation_length

FEWEST_BATCHES, MOST_BATCHES = 24, 200
_MANY = 100_000  # numbers of which one by one would take longer than run by run


@dataclass(frozen=True, eq=False)
class Linearised:
    """A fit at its solution: residuals (n,) over their noise, Jacobian (n, p), weights (n,).

    `prior` (p, p) is the information of the prior, `batch` (n,) the number of the batch of each
    row, from zero. `shared` (n, p) is the covariance of Jacobian and residuals by noise that is in
    both, where the fit has not taken it out; `captured` the share of the scores' variance that
    batches show, less than one where they are shorter than the noise lasts.
    """

    residuals: Array
    jacobian: Array
    weights: Array
    prior: Array
    batch: Index
    shared: Array | None = None
    captured: float = 1.0

    @cached_property
    def weighted(self) -> Array:
        """JᵀW, (p, n)."""
        return np.asarray(self.jacobian.T * self.weights)

    @cached_property
    def information(self) -> Array:
        """JᵀWJ + P, (p, p)."""
        return np.asarray(self.weighted @ self.jacobian + self.prior)

    @cached_property
    def scores(self) -> Array:
        """Σ w (J r − shared) of each batch, (B, p)."""
        return self.sum_scores(self.batch)

    def sum_scores(self, batch: Index) -> Array:
        """The same of other batches (n,)."""
        products = self.jacobian * self.residuals[:, None]
        if self.shared is not None:
            products -= self.shared
        products *= self.weights[:, None]
        return sums_by(batch, products)

    @property
    def square(self) -> float:
        """The weighted sum of squares of the residuals."""
        return float(self.weights @ self.residuals**2)


def batches_of(n: int, correlation: float) -> Index:
    """Consecutive rows in batches several correlation times long, (n,) numbers from zero.

    >>> np.bincount(batches_of(100, 1.0)).tolist()[:4]
    [1, 1, 1, 1]
    """
    wanted = int(n / max(3.0 * correlation, 1.0)) if correlation > 1 else n
    count = max(min(wanted, MOST_BATCHES, n), min(FEWEST_BATCHES, n))
    return np.asarray(np.arange(n) * count // n, dtype=np.intp)


def find_captured(batch: Index, correlation: float) -> float:
    """The share of the variance of sums that batches show, of what batches of three lengths do.

    Of noise whose correlation falls with the time τ, batches of L rows show
    1 − τ/L (1 − exp(−L/τ)); the correlation length is 2 τ.

    >>> find_captured(batches_of(6000, 50.0), 50.0)
    1.0
    >>> find_captured(batches_of(600, 100.0), 100.0) < 0.3
    True
    """
    length = len(batch) / (int(batch[-1]) + 1)
    shown = [1 - lasts * (1 - np.exp(-1 / lasts)) for lasts in (correlation / 2 / length, 1 / 6)]
    return float(min(shown[0] / shown[1], 1.0))


class Batches(NamedTuple):
    """The number of each row's batch (n,), and what they show of the variance of sums."""

    of: Index
    captured: float


def find_batches_beside(fit: Linearised, columns: Array) -> Batches:
    """Batches for the noise that is left beside columns (n, k).

    What is looked for makes residuals go together as noise with memory does, and would hide itself
    in long batches.
    """
    left = _leave_beside(fit, _scale(columns)[0])
    correlation = correlation_length(left, fit.weights)
    batch = batches_of(len(columns), correlation)
    return Batches(batch, find_captured(batch, correlation))


def sums_by(group: Index, rows: Array, groups: int = 0) -> Array:
    """Sums of rows (n, k) by the number of their group (n,), (groups, k)."""
    if rows.size > _MANY:  # each run first
        starts = np.flatnonzero(np.r_[True, group[1:] != group[:-1]])
        group, rows = group[starts], np.add.reduceat(rows, starts, axis=0)
    k, count = rows.shape[1], max(int(group.max()) + 1, groups)
    at = group[:, None] * k + np.arange(k)  # a number for each sum, so that one call makes them all
    sums = np.bincount(at.ravel(), rows.ravel(), count * k)
    return np.asarray(sums, dtype=np.float64).reshape(count, k)


def with_columns(fit: Linearised, columns: Array, shared: Array | None = None) -> Linearised:
    """The fit with further terms among its unknowns, so that what is left can be tested.

    Columns are scaled to that of largest size; the residuals become those with the terms. `shared`
    as for `score_tests`.
    """
    kept, size = _scale(columns)
    both = fit.shared
    if both is not None:
        more = np.zeros_like(columns) if shared is None else shared
        both = np.hstack([both, more[:, size > 0] / size[size > 0]])
    p, k = fit.jacobian.shape[1], kept.shape[1]
    prior = np.zeros((p + k, p + k))
    prior[:p, :p] = fit.prior
    prior[p:, p:] = _weak_prior(kept)
    left = _leave_beside(fit, kept)
    jacobian = np.hstack([fit.jacobian, kept])
    return replace(fit, residuals=left, jacobian=jacobian, prior=prior, shared=both)


def _scale(columns: Array) -> tuple[Array, Array]:
    """Columns that are not all zero at the size one, and the size of all."""
    size = np.sqrt(np.mean(columns**2, axis=0))
    return columns[:, size > 0] / size[size > 0], size


def _weak_prior(columns: Array) -> Array:
    """What keeps the size of columns finite that the fit holds already, (k, k)."""
    return np.asarray(1e-9 * len(columns) * np.eye(columns.shape[1]))


def _leave_beside(fit: Linearised, columns: Array) -> Array:
    """The residuals (n,) with columns (n, k) among the unknowns of the fit."""
    p, weighted = fit.jacobian.shape[1], columns.T * fit.weights
    crossed = fit.weighted @ columns
    own = weighted @ columns + _weak_prior(columns)
    information = np.block([[fit.information, crossed], [crossed.T, own]])
    pull = np.concatenate([fit.weighted @ fit.residuals, weighted @ fit.residuals])
    step = np.linalg.solve(information, pull)
    return np.asarray(fit.residuals - fit.jacobian @ step[:p] - columns @ step[p:])
