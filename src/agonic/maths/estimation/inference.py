"""What is not in a fit, or only perhaps: tests, which of many tests hold, averages over a term, and
how far to move a parameter of its shape.

Leaving a term out where a test does not see it makes standard errors several times too small just
below the limit of the test; keeping it always costs half of the accuracy where it is not there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import fdtrc

from agonic.arrays import Array, Index, Mask
from agonic.maths.estimation.leastsq import inverse


class Wald(NamedTuple):
    """The statistic xᵀ C⁻¹ x, and how often chance makes it as large."""

    statistic: float
    p_value: float


def wald(found: Array, covariance: Array, independent: float) -> Wald:
    """Whether k numbers (k,) with covariance (k, k) differ from zero.

    xᵀ C⁻¹ x / k follows F(k, m − k) where the errors' size itself is known from `independent` = m
    readings: the effective sample size, smaller than their number where errors are correlated."""
    k = len(found)
    statistic = float(found @ inverse(covariance) @ found)
    return Wald(statistic, float(fdtrc(k, max(independent - k, 1.0), statistic / k)))


def find_discoveries(p_values: Array, rate: float, tests: int | None = None) -> Mask:
    """Tests that hold with a false discovery rate of at most `rate` (Benjamini & Hochberg 1995).

    Of m p-values in order the first k hold, for the largest k with p₍k₎ ≤ rate·k/m; where there
    is nothing to find, any at all is found with a probability of at most `rate`. Inverse e-values
    may stand for p-values, and need no independence (Wang & Ramdas 2022).

    Parameters: p_values (m,), rate, and tests: m, where only the smallest p-values are given.
    """
    m = len(p_values) if tests is None else tests
    small = np.flatnonzero(p_values <= rate)
    order = small[np.argsort(p_values[small], kind="stable")]
    holds = p_values[order] <= rate * np.arange(1, len(order) + 1) / max(m, 1)
    k = int(np.flatnonzero(holds)[-1]) + 1 if holds.any() else 0
    found = np.zeros(len(p_values), dtype=bool)
    found[order[:k]] = True
    return found


class ModelAverage(NamedTuple):
    """All parameters with their covariance, and the probability of the term."""

    params: Array
    covariance: Array
    probability: float


def average_over_term(
    params: Array, covariance: Array, term: slice | Index, prior: float
) -> ModelAverage:
    """Parameters (p,) averaged over models with the term and without (Hoeting et al. 1999).

    With k numbers d in the term, their covariance V and q = dᵀV⁻¹d, a term of a size about which
    nothing is known but what d tells is, against none, as likely as

        B = (q/k)^(−k/2) exp((q − k)/2)  where q > k,   else 1

    and d is then d (1 − k/q). The others follow d along C_od V⁻¹.
    """
    d, spread = params[term], covariance[:, term][term]
    k = len(d)
    q = float(d @ inverse(spread) @ d)
    odds = prior / (1 - prior)
    if q > k:
        odds *= float(np.exp(min((q - k - k * np.log(q / k)) / 2, 700.0)))
    there, left = odds / (1 + odds), max(1 - k / max(q, 1e-300), 0.0)
    by = covariance[:, term] @ inverse(spread)  # of the term itself, one
    known = there * left * spread + there * (1 - there) * left**2 * np.outer(d, d)
    return ModelAverage(
        params - by @ d * (1 - there * left),
        covariance + by @ (known - spread) @ by.T,
        there,
    )


def find_move(terms: Array, slopes: Array, covariance: Array) -> tuple[float, float]:
    """How far to move a parameter θ of x(θ), and the standard error.

        K (x + x' δ) = K x + S x',   so   δ = (kᵀ C⁻¹ s) / (kᵀ C⁻¹ k),   sd² = 1 / (kᵀ C⁻¹ k)

    Parameters: `terms` (m,), the coefficients K of x; `slopes` (m,), those S of x' = ∂x/∂θ;
    `covariance` (m, m) of the slopes. An infinite standard error where the terms tell nothing.
    """
    weighted = inverse(covariance) @ terms
    information = float(terms @ weighted)
    if not information > 0.0:
        return 0.0, float("inf")
    return float(slopes @ weighted) / information, information**-0.5
